// Has the depth of every keyframe searched that stays in its map, and keeps it. Depth belongs to its keyframe: it moves
// with bundles and joins, and goes when the keyframe goes, or its map is built anew (engine/mapping/relief_check.h):
// then it is searched again, if its picture is still there. Pictures come from tracking (handed_picture.h); those of
// the newest keyframes are kept until they have served. One search is out at a time (depth_task.h); the oldest keyframe
// whose turn it is comes first. One that knows too little then is tried once more at the end: the map may have grown
// around it. What cannot keep up loses pictures, never time: a keyframe whose picture has gone has
// no depth. Reads the atlas only. thread-bound(mapping); takes its pictures and depths from `memory` at construction,
// and uses the heap for lists of points.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/depth/depth_task.h"
#include "engine/depth/handed_picture.h"
#include "engine/depth/kept_depth.h"
#include "engine/surface/view_selection.h"
#include "hal/core/memory_plan.h"

namespace haustra {

struct DepthCounters {
  std::uint64_t num_pictures = 0;    // of keyframes that were proposed
  std::uint64_t num_searches = 0;    // asked; those that were stopped, or whose map was built anew, are asked again
  std::uint64_t num_depths = 0;      // found; some went with their keyframes, or with the shape of their map
  std::uint64_t num_late = 0;        // keyframes whose pictures had to go before their turn came
  std::uint64_t num_too_little = 0;  // keyframes of too few points, or that no other one sees well, when last tried
  std::uint64_t num_in_vain = 0;     // the keyframe was culled meanwhile, or the device failed
  Duration search_time{0};
};

class DepthKeeper {
 public:
  // Everything named outlives it.
  DepthKeeper(const EngineConfig& config, const CameraModel& camera, const Atlas& atlas, PictureRing& pictures,
              DepthMailbox& mailbox, std::pmr::memory_resource* memory);
  // Ring, mailbox, pictures and depths.
  static MemoryPlan PlanMemory(const EngineConfig& config, int width_px, int height_px);

  // Takes an answer or a picture, or asks. False: there is nothing to do.
  bool Step() { return TakeIn() || Ask(); }
  // The first two.
  bool TakeIn();
  // While no picture will come: all keyframes that have one take their turn, those too that knew too little in theirs.
  void SetFinishing(bool is_finishing);

  // Null: there is none.
  const KeptDepth* DepthOf(KeyframeHandle keyframe) const;
  // That have a depth now.
  std::uint32_t num_keyframes() const;
  const DepthCounters& counters() const { return counters_; }

 private:
  struct Picture {
    Picture(int width_px, int height_px, int num_cells, std::pmr::memory_resource* memory)
        : grey(std::size_t(width_px) * height_px, memory), bgr(std::size_t(3) * num_cells, memory) {}

    std::uint64_t arrival = 0;  // counts from 1; 0: empty
    std::uint32_t frame_index = 0;
    TimePoint timestamp;
    KeyframeHandle keyframe;  // invalid: not made, or not yet
    bool was_asked = false;
    std::uint64_t turned_at = 0;   // of the keyframe when it was asked
    bool knew_too_little = false;  // when it was asked
    bool is_lent = false;          // to the task that is out
    std::pmr::vector<std::uint8_t> grey;
    std::pmr::vector<std::uint8_t> bgr;  // as KeptDepth
  };

  void TakeAnswer();
  bool Keep(const HandedPicture& handed);
  bool Ask();
  void FindKeyframe(Picture* picture) const;
  // Its keyframe is there, and was not asked about as its map is now.
  bool IsToAsk(const Picture& picture) const;
  Picture* OldestDue();
  bool Fill(const Picture& reference, DepthTask* task);
  DepthView ViewOf(const Picture& picture) const;
  void Look(const Keyframe& keyframe, SeeingView* view) const;

  const DepthConfig& config_;
  const int width_px_, height_px_;
  const Atlas& atlas_;
  PictureRing& handed_;
  DepthMailbox& mailbox_;
  std::pmr::vector<Picture> pictures_;
  std::pmr::vector<KeptDepth> depths_;  // by keyframe slot
  Picture* asked_ = nullptr;            // of the task that is out
  bool is_finishing_ = false;
  DepthCounters counters_;
  std::vector<SeeingView> views_;
  std::vector<Picture*> seen_by_;  // whose views these are
};

}  // namespace haustra
