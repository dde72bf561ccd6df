// Whether what a run joined belongs together: precision of merges, loops, relocalisations and recoveries.
//
// A join brings two parts into one frame of reference:
//   merge: the frames of the one map and those of the other, up to the merge.
//   relocalisation: the frames of the map before it, and those tracked from it on until tracking ends or the map
//     changes.
//   recovery: the same, for the first of neighbouring frames whose poses were found by brute force while tracking.
//   loop: of the frames from the one that was met again (details of the event: other_keyframe=N; the first of the map
//     when that is not known) to the loop the first third with all before it, and the last third. What lies between
//     joins them even without the loop.
// It is judged by the final poses of these frames, and it is false when
//   - one Sim(3) aligns both parts to the ground truth only with more than 3 times the RMS ATE that they have when
//     each is aligned on its own, and this error is above 1 % of the scene depth. A part with fewer than 10 frames, or
//     on a line, has no ATE of its own: the other's counts alone. Where the depth is not known the ratio decides.
//   - the relative pose of the parts is off by more than 10 degrees or 20 % of the scene depth: median over the pairs
//     of frames, one of each part, that were nearest to each other in place and direction; scale of the larger part.
// It cannot be judged when a part has no final pose with a true one (its map was dropped), or when neither has an ATE.
#pragma once

#include <vector>

#include "tools/evaluate/evaluated_frame.h"
#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

struct JoinOptions {
  double max_ate_ratio = 3.0;
  double min_ate_depths = 0.01;  // of the joined parts, share of the scene depth: the ratio of smaller ones is no fault
  double max_rotation_deg = 10.0;
  double max_translation_depths = 0.20;
  bool positions_only = false;  // the true orientations are not to be trusted: rotations are not compared
};

// One entry for each event merged, loop_closed and relocalised, and each recovery among the frames, in order.
std::vector<JoinEvaluation> JudgeJoins(const std::vector<EvaluatedFrame>& frames,
                                       const std::vector<RunEventRow>& events, const JoinOptions& options);

}  // namespace haustra::evaluate
