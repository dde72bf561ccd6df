// Applies a merge plan (system.md 9): two maps become one, or a loop inside one map is closed, by the same steps:
//   merge  the map with fewer keyframes (of equal ones the younger) is moved by the Sim(3) into the frame of the other,
//          which takes over its keyframes and points and keeps its id; matched points are fused, more are found by
//          guided search across the seam; the seam is welded by bundle adjustment; what is left of the map that moved
//          follows the weld by its essential graph
//   loop   the correction is spread over the map by the essential graph; then fusion, search and weld as above
// The atlas is consistent when Apply returns, whatever it returns. thread-bound(mapping); allocates; the time spent in
// the solvers is bounded by the deadline, that of the rest by the size of the windows and, for moving points, of the
// atlas.
#pragma once

#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/mapping/point_fusion.h"
#include "engine/merging/essential_graph.h"
#include "engine/merging/merge_plan.h"
#include "engine/merging/merging_config.h"
#include "engine/merging/weld.h"
#include "engine/noise_model.h"
#include "hal/vision_device.h"

namespace haustra {

class Merger {
 public:
  // Everything named outlives it; the adjuster may have other users between calls.
  Merger(const EngineConfig& config, const MergingConfig& options, const NoiseModel& noise, const CameraModel& camera,
         VisionDevice& device, SchurBundleAdjuster& adjuster);

  // kFailedPrecondition: a keyframe of the plan is gone, or tracking in another map; nothing was touched.
  // kInvalidArgument: the similarity is not one. kDeadlineExceeded, kInternal: the pose graph of a loop was stopped, or
  // it failed; the loop stays open and nothing was touched. `clock` may be null with kNoDeadline: then only iterations
  // bound the solvers (sequential mode). Maps are joined also when the time runs out: the one that moves then stands
  // where the plan, or as far as it came the weld, puts it in one piece, and no observation is taken out.
  Status Apply(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline, MergeOutcome* outcome);

 private:
  void Join(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline, MergeOutcome* outcome);
  Status Close(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline, MergeOutcome* outcome);
  void Fuse(const MergePlan& plan, Atlas* atlas, MergeOutcome* outcome);
  void WeldSeam(const Weld::Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline, MergeOutcome* outcome);

  const EngineConfig& config_;
  const NoiseModel& noise_;
  const MergingConfig& options_;
  PointFuser fuser_;
  Weld weld_;
  EssentialGraph graph_;
  PointCollector collector_;
  std::vector<KeyframeHandle> window_a_;
  std::vector<KeyframeHandle> window_b_;
  std::vector<KeyframeHandle> moved_;
  std::vector<MapPointHandle> points_;
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
