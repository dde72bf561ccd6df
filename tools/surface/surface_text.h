// What `haustra surface` says and writes about surfaces, for people and as JSON. reentrant.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/surface/depth_truth.h"
#include "tools/surface/map_surface.h"

namespace haustra::surface {

// One line a map.
std::string ToText(int map_id, const MapSurface& surface);
// A few lines.
std::string ToText(const DepthScore& score);
// score: nothing when there is no truth.
std::string ToJson(const std::vector<SurfaceMap>& maps, const std::vector<MapSurface>& surfaces,
                   const std::optional<DepthScore>& score);

// The depth of a keyframe as a 16-bit PGM file: inverse range; a comment tells how many map units there are to 1.
std::string DepthPgm(const DepthMap& depth);

}  // namespace haustra::surface
