// The unrolled walls that `haustra surface` has made, for the page of a run. thread-bound(caller).
#pragma once

#include <string>

#include "hal/core/status.h"

namespace haustra::report {

// folder: of `haustra surface`. HTML: for each map with a lumen its unrolled wall with axes and a table of its
// segments, for each other map why there is none. kNotFound, kUnavailable: a file. kInvalidArgument: surface.json is
// not what it should be; a surface of before there was a coverage is said to be one.
Result<std::string> WallPicturesHtml(const std::string& folder);

}  // namespace haustra::report
