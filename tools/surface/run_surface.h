// The surface of all maps of a run, as `haustra surface` and the end of `haustra run` make and write it.
// thread-bound(caller).
#pragma once

#include <string>
#include <vector>

#include "capture/deinterlace.h"
#include "engine/coverage/coverage_options.h"
#include "hal/core/status.h"
#include "hal/depth_options.h"
#include "tools/evaluate/run_output.h"
#include "tools/surface/map_coverage.h"
#include "tools/surface/map_surface.h"
#include "tools/surface/surface_input.h"
#include "tools/surface/surface_text.h"

namespace haustra::surface {

struct SurfaceRequest {
  std::string sequence;  // of the run: depth is searched in it; empty: the depth that the run kept is taken
  DeinterlaceChoice deinterlace = DeinterlaceChoice::kAuto;  // as in the run
  DepthOptions depth;                                        // how it is searched
  std::string device = "cpu";                                // where it is searched: "cpu" or "cuda"
  SurfaceOptions surface;                                    // with 0 threads: all cores
  CoverageOptions coverage;
};

struct RunSurface {
  std::vector<SurfaceMap> maps;        // that exist at the end, by id
  std::vector<MapSurface> surfaces;    // one a map; point into it
  std::vector<MapCoverage> coverages;  // one a map

  RunSurface() = default;
  RunSurface(RunSurface&&) = default;
  RunSurface& operator=(RunSurface&&) = default;
};

// Errors of ReadSurfaceMaps (kNotFound: there is no map), ReadKeptDepths, ReadKeyframePictures, SearchDepths,
// MakeMapCoverage. kFailedPrecondition: without a sequence, and the run kept no depth.
Result<RunSurface> MakeRunSurface(const evaluate::RunOutput& run, const SurfaceRequest& request);

// Why there is no surface, of each map, where none has a triangle; empty: one has.
std::string WhatIsMissing(const RunSurface& made);

struct SurfaceOutput {
  std::string folder;
  bool with_depth_maps = false;
  bool overwrite = false;
};

// Everything that README.md names; surface.json is the last. Errors of OutputFolder and WriteFile.
Status WriteRunSurface(const SurfaceOutput& output, const RunSurface& made, const SurfaceScore& score);

}  // namespace haustra::surface
