// Errors along the way: one map may be right everywhere and bent as a whole, or wrong at one place. reentrant.
#pragma once

#include <vector>

#include "tools/evaluate/evaluated_frame.h"
#include "tools/evaluate/evaluation.h"

namespace haustra::evaluate {

// Stretches of `length` (ground-truth units, above 0) of the true path, which runs through all frames with a true pose
// in order of time, lost ones included. `maps`: with the Sim(3) of each that has one.
std::vector<SegmentEvaluation> EvaluateSegments(const std::vector<EvaluatedFrame>& frames,
                                                const std::vector<MapEvaluation>& maps, double length);

}  // namespace haustra::evaluate
