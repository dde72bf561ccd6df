// What a run could have joined, by the ground truth, and what it did join.
#pragma once

#include <vector>

#include "tools/evaluate/evaluated_frame.h"
#include "tools/evaluate/evaluation.h"
#include "tools/evaluate/shared_view.h"

namespace haustra::evaluate {

// Occasions: pairs of maps, as they were begun, of which two localised clear frames share a view (shared_view.h).
// Taken: pairs that are one map at the end. Counted by pairs and not by merge events, because one merge of two merged
// maps takes several pairs at once, and so all of them can be had.
Recall FindMergeRecall(const std::vector<EvaluatedFrame>& frames, const SharedView& shared_view);

// Occasions: losses after which a clear frame shared a view with the lost map before tracking went on (the frame with
// which it went on included). Taken: those after which tracking went on in that map.
Recall FindRelocalisationRecall(const std::vector<EvaluatedFrame>& frames, const std::vector<RunEventRow>& events,
                                const SharedView& shared_view);

}  // namespace haustra::evaluate
