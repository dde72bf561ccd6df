#include "tools/surface/surface_text.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "engine/io/text_writer.h"
#include "tools/evaluate/number_text.h"
#include "tools/surface/coverage_text.h"

namespace haustra::surface {

using evaluate::Fixed;

namespace {

double DepthShare(const MapSurface& surface) {
  std::size_t all = 0, known = 0;
  for (const KeyframeDepth& each : surface.depths) {
    for (int i = 0; i < each.depth.num_cells(); ++i) known += each.depth.has_depth(i) ? 1 : 0;
    all += each.depth.num_cells();
  }
  return all > 0 ? static_cast<double>(known) / static_cast<double>(all) : 0.0;
}

}  // namespace

std::string ToText(int map_id, const MapSurface& surface) {
  std::string text = "map " + std::to_string(map_id) + ": " + std::to_string(surface.depths.size()) +
                     " keyframes with depth, on " + Fixed(100.0 * DepthShare(surface), 0) + " % of the picture, " +
                     std::to_string(surface.mesh.triangles.size()) + " triangles";
  if (surface.match_ms > 0.0) text += ", " + Fixed(surface.match_ms, 1) + " ms a keyframe in the median";
  if (surface.num_without_picture > 0) {
    text += ", " + std::to_string(surface.num_without_picture) + " keyframes without a picture";
  }
  if (surface.num_without_depth > 0) {
    text += ", " + std::to_string(surface.num_without_depth) + " without depth";
  }
  if (surface.num_refused_blocks > 0) {
    text += "; the volume is full, " + std::to_string(surface.num_refused_blocks) + " blocks were refused";
  }
  return text + "\n";
}

std::string FullText(int map_id, const MapSurface& surface) {
  if (surface.num_refused_blocks == 0) return {};
  return "map " + std::to_string(map_id) + ": the mesh is cut off: its volume is full, " +
         std::to_string(surface.num_refused_blocks) + " blocks were refused\n";
}

std::string ToText(const DepthScore& score) {
  const auto percent = [](double share) { return Fixed(100.0 * share, 1) + " %"; };
  return "depth of " + std::to_string(score.keyframes) + " keyframes against the truth, where two see the wall under " +
         "more than " + Fixed(kMinAngleDeg, 0) + " degrees:\n" + "  answered     " + percent(score.completeness()) +
         "\n  median error " + Fixed(100.0 * score.median_error, 2) + " % of the depth, " + Fixed(score.median_mm, 2) +
         " mm\n  within       2 %: " + percent(score.within_2) + ", 5 %: " + percent(score.within_5) +
         ", 10 %: " + percent(score.within_10) + "\n  RMS          " + Fixed(score.rms_mm, 2) + " mm\n";
}

std::string ToJson(const std::vector<SurfaceMap>& maps, const std::vector<MapSurface>& surfaces,
                   const std::vector<MapCoverage>& coverages, const SurfaceScore& score) {
  nlohmann::ordered_json json;
  json["maps"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const MapSurface& surface = surfaces[i];
    json["maps"].push_back({{"map_id", maps[i].map_id},
                            {"poses_checksum", maps[i].poses_checksum},
                            {"keyframes_with_depth", surface.depths.size()},
                            {"keyframes_without_picture", surface.num_without_picture},
                            {"keyframes_without_depth", surface.num_without_depth},
                            {"depth_share", DepthShare(surface)},
                            {"voxel_mu", surface.voxel_mu},
                            {"blocks", surface.num_blocks},
                            {"refused_blocks", surface.num_refused_blocks},
                            {"vertices", surface.mesh.positions.size()},
                            {"triangles", surface.mesh.triangles.size()}});
    AddCoverage(coverages[i], &json["maps"].back());
  }
  if (score.depth) {
    const DepthScore& depth = *score.depth;
    json["depth"] = {{"keyframes", depth.keyframes},         {"known_cells", depth.known_cells},
                     {"seen_cells", depth.seen_cells},       {"answered_cells", depth.answered_cells},
                     {"completeness", depth.completeness()}, {"median_error", depth.median_error},
                     {"within_2_percent", depth.within_2},   {"within_5_percent", depth.within_5},
                     {"within_10_percent", depth.within_10}, {"rms_mm", depth.rms_mm},
                     {"median_mm", depth.median_mm}};
  }
  if (score.coverage) json["coverage"] = ToJson(*score.coverage);
  return json.dump(2) + "\n";
}

std::string DepthPgm(const DepthMap& depth) {
  double most = 0.0;
  for (int i = 0; i < depth.num_cells(); ++i) most = std::max(most, depth.inverse_range(i));
  const double unit = most > 0.0 ? most / DepthMap::kMaxCode : 1.0;
  std::string bytes = "P5\n# inverse range along the ray, 0: not known; 1 is ";
  AppendNumber(unit, &bytes);
  bytes += " / map unit\n" + std::to_string(depth.width()) + " " + std::to_string(depth.height()) + "\n65535\n";
  for (int i = 0; i < depth.num_cells(); ++i) {
    const auto value = static_cast<int>(std::lround(depth.inverse_range(i) / unit));
    bytes.push_back(static_cast<char>(value >> 8));
    bytes.push_back(static_cast<char>(value & 0xff));
  }
  return bytes;
}

}  // namespace haustra::surface
