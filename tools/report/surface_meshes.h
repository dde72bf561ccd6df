// The meshes that `haustra surface` has made of the maps of a run, for pages that show them. reentrant.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "hal/core/status.h"
#include "tools/report/map_model.h"

namespace haustra::report {

// What surface.json says of each map ("maps", an array); empty where there is none. kInvalidArgument: not what `haustra
// surface` writes; kUnavailable: it cannot be read.
Result<nlohmann::ordered_json> ReadMapsOfSurface(const std::string& folder);

// PLY files as they are, by map id; of maps that are not in `models`, or have none in the folder, there is none. Nor is
// there any without surface.json, which is written last: such a surface is not whole. kInvalidArgument: a file is none,
// or surface.json says that a mesh is of another run's map; kUnavailable: a file cannot be read.
Result<std::map<int, std::string>> ReadSurfaceMeshes(const std::string& folder, const std::map<int, MapModel>& models);

}  // namespace haustra::report
