// Where the surface of a run lies in its folder: `haustra run` makes it there, and others look for it.
#pragma once

namespace haustra::report {

inline constexpr const char* kSurfaceFolder = "surface";

}  // namespace haustra::report
