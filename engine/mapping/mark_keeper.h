// Sets and removes a doctor's marks (engine/atlas/mark.h), and measures them anew as the map becomes better. A mark is
// set in a frame that the doctor saw, which need not be a keyframe: the tracker says of every frame where it was
// (engine/tracking/answered_frame.h), and the last kKeptAnswers of this session can be marked. Full pool: refused with
// a message. thread-bound(mapping).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/atlas/mark.h"
#include "engine/mapping/mapping_state.h"
#include "engine/mapping/wall_fit.h"
#include "engine/tracking/answered_frame.h"
#include "hal/core/status.h"

namespace haustra {

// Of the frames that were answered when MarkKeeper::Set was called, the last: no older one takes its place.
inline constexpr std::uint32_t kNewestFrame = 0xffffffffu;

struct MarkRequest {
  std::uint32_t frame_index = kNewestFrame;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  MarkLabel label;
};

class MarkKeeper {
 public:
  // Keyframes around the nearest one that are asked when it knows too little of the wall.
  static constexpr int kNeighboursOfMark = 6;

  // It outlives this.
  explicit MarkKeeper(MappingState& state)
      : state_(state), fit_(state.camera, (1 + kNeighboursOfMark) * state.config.features.max) {}

  // When tracking is at rest: frame numbers begin anew, and no frame that was answered before can be marked any more.
  void BeginSession();
  // Takes what the tracker has answered since; between two steps of the mapper.
  void HearTracker();

  // kFailedPrecondition: the frame has no measured pose, or one of before the map was built anew, or too little of the
  // map is near. kNotFound: no such frame is remembered. kInvalidArgument: label, or a pixel that shows no scene.
  // kCapacityExceeded: there are as many as may be.
  Result<MarkId> Set(const MarkRequest& request);
  // kNotFound.
  Status Remove(std::string_view label);

  // Measures some marks of the active map again, in turn, as their keyframes see the wall now.
  void Refine();
  // The active map was built anew (relief_check.h): all of them now, along the rays that their keyframes have still. As
  // in Set, neighbours are asked where a keyframe knows too little: any wall is nearer to the truth than none.
  void MapWasTurned();

 private:
  const AnsweredFrame* Find(std::uint32_t frame_index) const;
  std::string WhyUnknown(std::uint32_t frame_index) const;
  void Refine(int most, int num_neighbours);
  bool MayBeElsewhere(MapHandle map) const;
  Result<FittedWall> FitAround(const SE3& cam_from_map, KeyframeHandle keyframe, const Eigen::Vector2d& pixel,
                               int num_neighbours);

  MappingState& state_;
  WallFit fit_;
  std::array<AnsweredFrame, kKeptAnswers> frames_;  // the latest, by their number among all modulo the size
  std::uint64_t num_frames_ = 0;                    // of this session, that were heard
  std::uint64_t newest_number_ = 0;                 // of the last that was heard, or came before this session
  bool is_newest_known_ = true;                     // no newer frame's answer was lost
  std::uint32_t next_to_refine_ = 0;                // slot
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
