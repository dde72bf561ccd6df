// A window of the atlas as a bundle adjustment: keyframes that move, all points that they see, and a ring of keyframes
// around them that holds the gauge. Filled from the atlas once, solved, and written back once. Local bundle, settling
// and weld differ in which keyframes they choose, and in what holds the gauge where there is no ring. Solve
// works on copies: the weld lets keyframes and points come and go meanwhile.
// thread-bound(mapping); allocates, bounded by the size of the window.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/noise_model.h"
#include "engine/optim/schur_bundle_adjustment.h"

namespace haustra {

class BundleWindow {
 public:
  // Everything named outlives it; the adjuster may have other users between calls.
  BundleWindow(const MemoryConfig& memory, const NoiseModel& noise, const CameraModel& camera,
               SchurBundleAdjuster& adjuster);

  // An empty window. Then Add, then Close, then Adjust.
  void Clear();
  // A keyframe that moves. False: the window has it already.
  bool Add(KeyframeHandle keyframe);
  // Takes the points in, and for the ring those keyframes outside that see most of them: at most `max_fixed`, of those
  // that `may_hold` (empty: any) lets hold the gauge.
  void Close(const Atlas& atlas, int max_fixed, const std::function<bool(KeyframeHandle)>& may_hold);
  // Of the keyframes that were added, the i-th holds the gauge, too.
  void Fix(std::size_t i) { problem_.poses[i].is_fixed = true; }
  // Solves and writes back what was gained. Takes out the observations that the adjuster calls outliers; on the word of
  // a bundle that was stopped none goes. kNone, or an error of the adjuster: the atlas is as it was.
  Result<BundleSummary> Adjust(const BundleOptions& options, Atlas* atlas);

  // The two halves of Adjust. Solve may be called again, and goes on with poses and points where they are.
  Result<BundleSummary> Solve(const BundleOptions& options) { return adjuster_.Adjust(camera_, options, &problem_); }
  // Passes over what has gone since the window was closed.
  void WriteBack(Atlas* atlas);
  // Overrules the solver before it: where the i-th point of the problem is.
  void PlacePoint(std::size_t i, const Eigen::Vector3d& position) { problem_.points[i].position = position; }

  // Those that were added, in their order.
  std::span<const KeyframeHandle> moving() const { return {poses_.data(), num_moving_}; }
  // It is one of the keyframes that were added, or one of the points.
  bool Has(KeyframeHandle keyframe) const {
    const std::int32_t i = pose_slots_[keyframe.index];
    return i >= 0 && static_cast<std::size_t>(i) < num_moving_ && poses_[static_cast<std::size_t>(i)] == keyframe;
  }
  bool Has(MapPointHandle point) const {
    const std::int32_t i = point_slots_[point.index];
    return i >= 0 && points_[static_cast<std::size_t>(i)] == point;
  }
  std::size_t num_fixed() const { return poses_.size() - num_moving_; }
  int num_points() const { return static_cast<int>(points_.size()); }
  // As it was filled, or after Adjust as it was solved. Its first poses are those of moving().
  const BundleProblem& problem() const { return problem_; }

 private:
  std::vector<KeyframeHandle> ListRing(const Atlas& atlas);
  void ReserveObservations(const Atlas& atlas);
  void Fill(const Atlas& atlas);

  const NoiseModel& noise_;
  const CameraModel& camera_;
  SchurBundleAdjuster& adjuster_;
  BundleProblem problem_;
  std::vector<KeyframeHandle> poses_;  // of problem_.poses: those that move, then the ring
  std::size_t num_moving_ = 0;
  std::vector<MapPointHandle> points_;     // of problem_.points
  std::vector<std::int32_t> pose_slots_;   // by keyframe slot: index in poses_, -1
  std::vector<std::int32_t> point_slots_;  // by point slot: index in points_, -1
  std::vector<int> ring_votes_;            // by keyframe slot: points of the window that it sees
};

}  // namespace haustra
