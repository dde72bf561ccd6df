#include "tools/surface/map_surface.h"

#include <algorithm>
#include <utility>

#include "engine/surface/depth_fusion.h"
#include "engine/surface/depth_jumps.h"
#include "tools/command/parallel_for.h"

namespace haustra::surface {
namespace {

// A wall is asked about to a limit: with a keyframe every few millimetres more of them say the same.
constexpr std::size_t kMaxWitnesses = 16;

// Cells in which no picture has shown a wall lie outside the window of the scope, or under its overlay.
std::vector<std::uint8_t> CellsOfScene(const FoundDepths& found) {
  std::vector<std::uint8_t> shows_scene;
  for (const FoundDepth& each : found.depths) {
    shows_scene.resize(each.raw.num_cells());
    for (int i = 0; i < each.raw.num_cells(); ++i) shows_scene[i] |= each.raw.has_depth(i) ? 1 : 0;
  }
  return shows_scene;
}

// Of each keyframe those whose word is asked for: the nearest ones that can see the same wall, by index.
std::vector<std::vector<int>> WitnessesOf(const FoundDepths& found) {
  std::vector<Eigen::Vector3d> centres;
  std::vector<double> farthest;
  for (const FoundDepth& each : found.depths) {
    centres.push_back(each.keyframe->cam_from_map.InverseTranslation());
    farthest.push_back(each.raw.FarthestRange());
  }
  std::vector<std::vector<int>> witnesses(found.depths.size());
  for (int own = 0; own < static_cast<int>(found.depths.size()); ++own) {
    std::vector<std::pair<double, int>> near;
    for (int other = 0; other < static_cast<int>(found.depths.size()); ++other) {
      const double distance = (centres[other] - centres[own]).norm();
      if (other != own && distance <= farthest[own] + farthest[other]) near.emplace_back(distance, other);
    }
    std::sort(near.begin(), near.end());
    near.resize(std::min(near.size(), kMaxWitnesses));
    for (const auto& [distance, other] : near) witnesses[own].push_back(other);
    std::sort(witnesses[own].begin(), witnesses[own].end());
  }
  return witnesses;
}

std::vector<PosedDepth> Chosen(const std::vector<PosedDepth>& depths, const std::vector<int>& indices) {
  std::vector<PosedDepth> chosen;
  for (const int i : indices) chosen.push_back(depths[i]);
  return chosen;
}

}  // namespace

Result<MapSurface> MakeMapSurface(const SurfaceMap& map, const FoundDepths& found, const SurfaceOptions& options) {
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(map.camera));
  MapSurface surface;
  surface.step_px = found.step_px;
  surface.num_without_picture = found.num_without_picture;
  surface.num_without_depth = found.num_without_depth;
  surface.match_ms = found.match_ms;
  const auto num_depths = static_cast<int>(found.depths.size());
  const int num_threads = std::max(1, options.num_threads);
  const std::vector<std::vector<int>> witnesses = WitnessesOf(found);
  std::vector<PosedDepth> raw, checked;
  std::vector<DepthMap> checked_maps;
  checked_maps.reserve(found.depths.size());
  for (const FoundDepth& each : found.depths) {
    raw.push_back({&each.raw, each.keyframe->cam_from_map});
    checked_maps.emplace_back(each.raw.width(), each.raw.height());
    checked.push_back({&checked_maps.back(), each.keyframe->cam_from_map});
  }
  ParallelFor(num_depths, num_threads, [&](int i, int) {
    if (IsStopped(options.stop)) return;
    CheckDepth(camera, found.step_px, raw[i], Chosen(raw, witnesses[i]), options.consistency, &checked_maps[i]);
  });
  const std::vector<std::uint8_t> shows_scene = CellsOfScene(found);
  surface.depths.resize(found.depths.size());
  ParallelFor(num_depths, num_threads, [&](int i, int) {
    if (IsStopped(options.stop)) return;
    const FoundDepth& own = found.depths[i];
    surface.depths[i] = {own.keyframe, own.frame_idx, own.stored_frame, DepthMap(own.raw.width(), own.raw.height())};
    FillDepth(camera, found.step_px, checked[i], Chosen(checked, witnesses[i]), shows_scene, options.consistency,
              &surface.depths[i].depth);
    EraseJumps(camera, found.step_px, JumpOptions(), &surface.depths[i].depth);
  });
  FusionOptions fusion_options;
  surface.voxel_mu = fusion_options.voxel_mu = options.voxel_share * map.depth_mu;
  if (!(surface.voxel_mu > 0.0) || found.depths.empty()) return surface;
  DepthFusion fusion(camera, found.step_px, fusion_options, options.max_blocks);
  for (std::size_t i = 0; i < found.depths.size(); ++i) {
    if (IsStopped(options.stop)) break;
    const KeyframeDepth& depth = surface.depths[i];
    fusion.Integrate(depth.depth, found.depths[i].colour.view(), depth.keyframe->cam_from_map);
  }
  if (IsStopped(options.stop)) return Status(StatusCode::kCancelled, "stopped");
  surface.num_blocks = fusion.blocks().num_blocks();
  surface.num_refused_blocks = fusion.blocks().num_refused();
  surface.mesh = ExtractMesh(fusion.blocks(), surface.voxel_mu, options.mesh);
  return surface;
}

}  // namespace haustra::surface
