// How windows agree on the intrinsics after a joint adjustment: what each is worth, and what they leave uncertain.
// Efron 1982, "The jackknife, the bootstrap and other resampling plans". reentrant. Allocates.
#pragma once

#include <vector>

#include "engine/calibration/joint_adjustment.h"

namespace haustra::calibration {

// Sets the weights for the next adjustment. A window that pulls much harder than is usual loses weight; and all lose
// some when they pull harder than their noise explains, which gives the prior its due.
void WeighWindows(const IntrinsicPrior& prior, const Intrinsics& intrinsics, std::vector<AdjustedWindow>* windows);

// Standard deviations: the larger of what the noise leaves, and of the jackknife over windows (one Newton step each).
IntrinsicVector SpreadOf(const IntrinsicPrior& prior, const Intrinsics& intrinsics,
                         const std::vector<AdjustedWindow>& windows);

}  // namespace haustra::calibration
