// What `haustra surface` says and writes about surfaces, for people and as JSON. reentrant.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/surface/coverage_truth.h"
#include "tools/surface/depth_truth.h"
#include "tools/surface/map_coverage.h"
#include "tools/surface/map_surface.h"

namespace haustra::surface {

// One line a map.
std::string ToText(int map_id, const MapSurface& surface);
// One line, where the volume was too small for all of the wall; else empty.
std::string FullText(int map_id, const MapSurface& surface);
// A few lines.
std::string ToText(const DepthScore& score);
// What is known of the truth; nothing where it is not.
struct SurfaceScore {
  std::optional<DepthScore> depth;
  std::optional<CoverageScore> coverage;
};
// Surfaces and coverages: one a map.
std::string ToJson(const std::vector<SurfaceMap>& maps, const std::vector<MapSurface>& surfaces,
                   const std::vector<MapCoverage>& coverages, const SurfaceScore& score);

// The depth of a keyframe as a 16-bit PGM file: inverse range; a comment tells how many map units there are to 1.
std::string DepthPgm(const DepthMap& depth);

}  // namespace haustra::surface
