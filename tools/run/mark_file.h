// Marks that are to be set during a run: a table `frame,u,v,label`, a line each, with a header of these words. Frames
// and pixels are those of the recording, whatever part of it the run reads, and whether it halves them.
#pragma once

#include <string>
#include <vector>

#include "engine/mapping/mark_keeper.h"
#include "hal/core/status.h"

namespace haustra {

// In the order of their frames; of one frame in that of the file. kNotFound, kUnavailable: the file. kInvalidArgument,
// with file and line: no such table, a number or a label that is none.
Result<std::vector<MarkRequest>> ReadMarkFile(const std::string& path);

}  // namespace haustra
