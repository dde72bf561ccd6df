// Applies a merge plan: two maps become one, or a loop inside one map is closed, by the same steps:
//   merge  the map with fewer keyframes (of equal ones the younger) is moved by the Sim(3) into the frame of the other,
//          which takes over its keyframes and points and keeps its id; matched points are fused, more are found by
//          guided search across the seam; the seam is welded by bundle adjustment; what is left of the map that moved
//          follows the weld by its essential graph
//   loop   the correction is spread over the map by the essential graph; then fusion, search and weld as above
// A join is made in slices. What takes long is worked out on copies (graph and weld) or is small in itself (one guided
// search). The map is moved twice, each time inside one slice: by the plan or the loop's graph, and by the weld.
//
// Between two slices the atlas is the caller's: keyframes and points may come, go and be fused. Bundles may move them
// until the first move (outcome().has_moved), and what they moved keeps its place beside its neighbours. After it they
// wait until the join is done: what holds the seam in a bundle is what the weld is working on.
//
// What holds whenever Step returns, whatever it returns:
//   - The atlas is consistent (atlas/invariants.h).
//   - No map is torn. Each move takes along all of the map that is there when it is made: a keyframe that came since
//     Begin follows the one that it shares most points with, and a new point the oldest keyframe that sees it.
//   - Before the first move nothing was touched.
//   - After it the maps are one. A join that is ended there, or later, is less exact, but nothing has to be finished.
// thread-bound(mapping); allocates. A slice lasts as long as it is granted and one piece of work more. The largest
// pieces are the moves, which are linear in the keyframes and points of the atlas, and have a slice of their own.
#pragma once

#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/mapping/point_fusion.h"
#include "engine/merging/essential_graph.h"
#include "engine/merging/join_limits.h"
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

  // Takes a plan in place of the one before. Touches nothing. kFailedPrecondition: a keyframe of the plan is gone, or
  // tracking in another map. kInvalidArgument: the similarity is not one.
  Status Begin(const MergePlan& plan, const Atlas& atlas);

  enum class Progress { kMore, kDone };
  // The next slice. `tracked`: a keyframe of the map of a where the tracker is now. Without limits it is the last one
  // (sequential mode), and only iterations bound the solvers.
  // Errors end the join, and nothing was touched: kFailedPrecondition (a keyframe of the plan has gone since),
  // kDeadlineExceeded (before the first move), kInternal (the pose graph of a loop has no solution). When the time runs
  // out after the first move the join is done: the map that moved then stands where the plan, or as far as it came the
  // weld, puts it in one piece, and no observation is taken out.
  Result<Progress> Step(const JoinLimits& limits, KeyframeHandle tracked, Atlas* atlas);

  // After a slice; complete when it is done.
  const MergeOutcome& outcome() const { return outcome_; }

 private:
  // In their order, but for the graph: of a loop it is solved before the move, of a merge after the weld.
  enum class Stage { kCapture, kSolve, kMove, kFuse, kSearch, kWeld, kPlace, kDone };

  Status DoNext(const JoinLimits& limits, Atlas* atlas);
  void PartEnds(const Atlas& atlas);
  Status SetUpLoop(const Atlas& atlas);
  Status Solve(const JoinLimits& limits);
  void MoveMap(Atlas* atlas);
  void BeginSearch();
  void FusePlan(Atlas* atlas);
  void SearchNext(Atlas* atlas);
  void WeldSeam(const JoinLimits& limits, const Atlas& atlas);
  void CopySeam(const Atlas& atlas);
  void SetUpFollowers(const Atlas& atlas);
  void PlaceSeam(Atlas* atlas);
  void TakeAlong(Atlas* atlas);
  void DropGone(const Atlas& atlas);

  const EngineConfig& config_;
  const MergingConfig& options_;
  PointFuser fuser_;
  Weld weld_;
  EssentialGraph graph_;
  PointCollector collector_;

  MergePlan plan_;
  MergeOutcome outcome_;
  Stage stage_ = Stage::kDone;
  bool is_stopped_ = false;         // a solver was: it goes on in the next slice
  bool has_weld_ = false;           // the seam was copied
  MapHandle map_;                   // that the graph is of; after the move the one that holds everything
  MapHandle tracked_map_;           // where tracking has to be
  bool a_stays_ = false;            // of a merge; of a loop the side of b stays
  KeyframeId first_new_ = 0;        // keyframes from this one on came since Begin
  KeyframeId first_unwelded_ = 0;   // since the seam was copied
  std::size_t num_welded_old_ = 0;  // of the weld's moving side: not new
  std::vector<KeyframeHandle> window_a_;
  std::vector<KeyframeHandle> window_b_;
  struct Search {
    bool is_from_b = false;
    bool is_first = false;  // of its direction
    KeyframeHandle into;
  };
  std::vector<Search> searches_;  // those left, the next one last
  std::vector<MapPointHandle> points_;
  std::vector<Covisible> covisible_;
  struct Taken {
    KeyframeHandle keyframe;
    std::size_t kin_idx = 0;  // of the weld's keyframes, the one whose correction it has
  };
  std::vector<Taken> taken_;
};

}  // namespace haustra
