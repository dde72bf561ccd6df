// What `haustra surface` says and writes about the coverage of the wall, for people, as CSV and as JSON. reentrant.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tools/surface/coverage_truth.h"
#include "tools/surface/map_coverage.h"

namespace haustra::surface {

// "well", "poorly", "never"
const char* ToText(WallView view);

// One line a map; the score a few lines.
std::string ToText(int map_id, const MapCoverage& coverage);
std::string ToText(const CoverageScore& score);

// A line for each cell of the claimed rows:
// row,column,length_radii,angle_deg,x_mu,y_mu,z_mu,seen,first_s,last_s
// Length begins where the scope first was; seen is "well", "poorly" or "never", and without times in the last case.
std::string CellsCsv(const WallGrid& wall);

// Adds "lumen", and where there is one "wall_coverage", "seen_poorly" and "segments".
void AddCoverage(const MapCoverage& coverage, nlohmann::ordered_json* map);
// Of each map "map_id" and these.
nlohmann::ordered_json ToJson(const std::vector<SurfaceMap>& maps, const std::vector<MapCoverage>& coverages);
nlohmann::ordered_json ToJson(const CoverageScore& score);

}  // namespace haustra::surface
