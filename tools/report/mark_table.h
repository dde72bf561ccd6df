// The marks of a run as tables. reentrant.
#pragma once

#include "tools/evaluate/run_output.h"
#include "tools/evaluate/text_table.h"

namespace haustra::report {

// A row for each mark that exists at the end: where and when it was set, in how many frames it was in which state, and
// when it was first and last in front of the scope.
evaluate::TextTable MakeMarkTable(const evaluate::RunOutput& run);

// Those that could not be set, and why.
evaluate::TextTable MakeRefusedMarkTable(const evaluate::RunOutput& run);

}  // namespace haustra::report
