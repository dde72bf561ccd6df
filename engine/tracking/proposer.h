// What tracking asks of mapping: keyframes, new maps, and where a frame without a pose is. Fills the slots of the ring
// in place and never waits. Full: the proposal is given up, and the ring counts it. At most two wait at a time: a
// keyframe or a frame without a place, and a new map. thread-bound(tracking), rt-safe.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/config.h"
#include "engine/noise_model.h"
#include "engine/tracking/initialiser.h"
#include "engine/tracking/pose_search.h"
#include "engine/tracking/tracker_state.h"
#include "engine/tracking/tracking_link.h"
#include "hal/vision_device.h"

namespace haustra {

// How many of the mapper's messages the tracker has heard: none is lost, so the count says which.
struct RepliesHeard {
  std::uint64_t num_found = 0;
  std::uint64_t num_reframings = 0;
};

class Proposer {
 public:
  // `frame` is the tracker's current one.
  Proposer(const EngineConfig& config, VisionDevice& device, TrackingLink& link, const NoiseModel& noise,
           const ProposedView& frame, const RepliesHeard& heard);

  // Whether the tracked frame shows what the map lacks. `reference` is one of `map`. has_fewer_points: not all points
  // of the map were searched.
  bool IsKeyframe(const Tracking& tracking, const PoseEstimate& estimate, const LocalMap& map,
                  const LocalKeyframe& reference, bool has_fewer_points) const;
  // True: the mapper shares the frame's feature set, and the course begins anew.
  bool ProposeKeyframe(const PoseEstimate& estimate, const LocalMap& map, Tracking* tracking);
  // The initialiser's views and the frame; nothing when the ring is full, and the initialiser keeps its views.
  std::optional<AwaitingMap> ProposeMap(const Lost& lost, Initialiser* initialiser);
  // One frame at a time, when the mapper has nothing else to do. The mapper shares the feature set.
  bool AskForPlace();

 private:
  bool is_mapper_busy() const { return link_.num_pending.load(std::memory_order_acquire) > 0; }
  KeyframeProposal* Begin(ProposalKind kind);
  void Commit();

  const EngineConfig& config_;
  VisionDevice& device_;
  TrackingLink& link_;
  const NoiseModel& noise_;
  const ProposedView& frame_;
  const RepliesHeard& heard_;
  std::uint64_t next_founding_id_ = 1;
};

}  // namespace haustra
