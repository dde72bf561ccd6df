// The periodic motion between scope and wall as a table. reentrant.
#pragma once

#include "tools/evaluate/run_output.h"
#include "tools/evaluate/text_table.h"

namespace haustra::report {

// A row for each part of the run in which a map saw such a motion, and one for each map that saw none or is too short.
evaluate::TextTable MakeMotionTable(const evaluate::RunOutput& run);

}  // namespace haustra::report
