// The pose of the current frame by brute force: everything in the picture against everything in the local map, no
// prediction. Finds a pose that was lost, and bears witness for one that few points hold
// (decisions/2026-11-23-brute-force-bears-witness.md). thread-bound(tracking); rt-safe after construction.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geometry/rng.h"
#include "engine/tracking/frame_result.h"
#include "engine/tracking/pose_search.h"

namespace haustra {

class PoseRecovery {
 public:
  // What brute force says of a pose that guided search has found, or has not.
  enum class Verdict {
    kNone,       // there is none
    kStands,     // it stays as it was; without an answer in time nothing speaks against it
    kBetter,     // the same pose, with more points
    kRecovered,  // another one
  };

  // `search` has the frame and its estimate, which a recovered pose replaces; `parts` are those of it.
  PoseRecovery(const PoseSearch::Parts& parts, PoseSearch& search);
  // Of its workspaces, on the heap.
  static std::size_t BytesFor(int max_features, int max_points);

  // For a frame without a prediction (is_lost) more is asked of the pose. False: the estimate means nothing.
  bool Recover(bool is_lost);
  Verdict Question(bool has_pose);
  // Of the last search, by either.
  SearchOutcome outcome() const { return outcome_; }

 private:
  SearchOutcome Search(bool is_lost);
  bool SearchByBruteForce();
  bool IsQuestionedPoseConfirmed();
  bool BruteForceAgrees(double min_share) const;
  SearchOutcome JudgeChosenPose();

  const PoseSearch::Parts parts_;
  PoseSearch& search_;
  Rng rng_;
  SearchOutcome outcome_ = SearchOutcome::kNotSearched;
  PoseEstimate questioned_;
  std::vector<PointMatch> alike_;  // all that brute force found in the current frame

  // Workspaces.
  std::vector<DescriptorRef> refs_;
  std::vector<Match> found_;
  std::int32_t num_found_ = 0;
  std::vector<std::uint8_t> is_matched_point_;
  std::vector<Eigen::Vector2d> pixels_;
};

}  // namespace haustra
