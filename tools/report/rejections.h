// Candidates for a merge, a loop or a relocalisation that were turned down: which check decided, on what counts.
// 'Why no merge here.' reentrant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "tools/evaluate/run_output.h"
#include "tools/evaluate/text_table.h"

namespace haustra::report {

struct Rejection {
  std::int64_t frame_idx = 0;
  std::string what;    // merge, loop, relocalisation
  std::string reason;  // word of the engine: no_similarity
  evaluate::RunEventRow event;
};

// Events merge_rejected and frame_not_found, in order.
std::vector<Rejection> FindRejections(const std::vector<evaluate::RunEventRow>& events);

// What the check means, for a person; empty for a word that is not known here.
std::string_view Explanation(std::string_view reason);

// A row a reason, the most frequent first.
evaluate::TextTable MakeReasonTable(const std::vector<Rejection>& rejections);

// A row a candidate, with its counts; at most max_rows rows. Times from the first frame on.
evaluate::TextTable MakeRejectionTable(const std::vector<Rejection>& rejections,
                                       const std::vector<evaluate::RunFrame>& frames, std::size_t max_rows);

}  // namespace haustra::report
