// The surface of the wall at the end of a run that kept depth. thread-bound(caller).
#pragma once

#include <string>

#include "hal/core/status.h"
#include "tools/run/run_summary.h"
#include "tools/surface/map_surface.h"

namespace haustra {

// With options.num_threads 0 on all cores. Makes FOLDER/surface of the files of a finished run, with what `haustra
// surface FOLDER --out FOLDER/surface` writes. A run without a map, or without a depth that keyframes agree on, has
// none, and that is no error. Errors of evaluate::ReadRunOutput, surface::MakeRunSurface and WriteRunSurface: nothing
// of a surface is left, and the files of the run are as they were. kFailedPrecondition: one was there before, which
// stays. kCancelled: options.stop. `figures` also says why there is none.
Status MakeSurfaceOfRun(const std::string& folder, const surface::SurfaceOptions& options, SurfaceFigures* figures);

}  // namespace haustra
