#include "tools/surface/map_coverage.h"

#include <algorithm>
#include <cstdint>

#include "engine/camera/camera_model.h"
#include "engine/camera/dark_surround.h"
#include "engine/coverage/lumen_finder.h"
#include "engine/coverage/wall_observer.h"

namespace haustra::surface {
namespace {

// The wall as the depths of the keyframes say. The mesh has less of it: its volume leaves out what few keyframes see,
// and that is where a wall is missed.
std::vector<WallPatch> PatchesOf(const MapSurface& surface, const CameraModel& camera) {
  std::vector<WallPatch> patches;
  for (const KeyframeDepth& each : surface.depths) {
    const DepthMap& depth = each.depth;
    const SE3 map_from_cam = each.keyframe->cam_from_map.Inverse();
    for (int i = 0; i < depth.num_cells(); ++i) {
      const Eigen::Vector2d centre(CellCentrePx(i % depth.width(), surface.step_px),
                                   CellCentrePx(i / depth.width(), surface.step_px));
      Eigen::Vector3d bearing;
      if (!depth.has_depth(i) || !camera.Unproject(centre, &bearing)) continue;
      const double side = depth.range_mu(i) * surface.step_px / camera.focal_px();
      patches.push_back({map_from_cam * Eigen::Vector3d(depth.range_mu(i) * bearing), side * side});
    }
  }
  return patches;
}

// Where no mask tells, what of the picture shows the scene: all but what no keyframe has a depth of, from the edge on.
// A dark surround has none (DepthMatcher).
std::vector<std::uint8_t> LearnMask(const MapSurface& surface, const CameraModel& camera) {
  const int step = surface.step_px, width = camera.width_px(), height = camera.height_px();
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(width) * height, 255);
  if (surface.depths.empty()) return mask;
  const int columns = surface.depths.front().depth.width(), rows = surface.depths.front().depth.height();
  std::vector<std::uint8_t> has_depth(static_cast<std::size_t>(columns) * rows, 0);
  for (const KeyframeDepth& each : surface.depths) {
    for (int i = 0; i < each.depth.num_cells(); ++i) has_depth[i] |= each.depth.has_depth(i) ? 1 : 0;
  }
  GoInFromEdges(columns, rows, [&](int x, int y) {
    if (has_depth[static_cast<std::size_t>(y) * columns + x] != 0) return false;
    // What is left of the picture beyond the last cells goes with them.
    const int right = x + 1 == columns ? width : (x + 1) * step, below = y + 1 == rows ? height : (y + 1) * step;
    for (int row = y * step; row < below; ++row) {
      std::fill_n(&mask[static_cast<std::size_t>(row) * width + x * step], right - x * step, std::uint8_t{0});
    }
    return true;
  });
  return mask;
}

}  // namespace

std::vector<LookingFrame> FramesOf(const evaluate::RunOutput& run, int map_id) {
  std::vector<LookingFrame> frames;
  for (const evaluate::RunFrame& frame : run.frames) {
    if (frame.map_id != map_id) continue;
    const double time_s = static_cast<double>(frame.timestamp_ns - run.frames.front().timestamp_ns) * 1e-9;
    frames.push_back({time_s, frame.world_from_cam.Inverse()});
  }
  return frames;
}

Result<MapCoverage> MakeMapCoverage(const SurfaceMap& map, const MapSurface& surface,
                                    std::span<const LookingFrame> frames, ImageView mask, const std::atomic<bool>* stop,
                                    const CoverageOptions& options) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(map.camera));
  std::vector<Eigen::Vector3d> path, wall;
  for (const LookingFrame& frame : frames) path.push_back(frame.cam_from_map.InverseTranslation());
  const std::vector<WallPatch> patches = PatchesOf(surface, camera);
  wall.reserve(patches.size());
  for (const WallPatch& patch : patches) wall.push_back(patch.position_in_map);
  MapCoverage coverage;
  const Result<Lumen> lumen = FindLumen(path, wall);
  if (lumen.code() == StatusCode::kNotFound) {
    coverage.no_lumen = lumen.status().message();
    return coverage;
  }
  HAUSTRA_TRY(lumen.status());
  WallGrid& grid = coverage.wall.emplace(*lumen);
  grid.SetWall(patches, options.max_hole_cells);
  std::vector<std::uint8_t> learnt;
  if (mask.is_empty()) {
    learnt = LearnMask(surface, camera);
    mask = {learnt.data(), camera.width_px(), camera.height_px(), camera.width_px(), PixelFormat::kGrey8};
  }
  const WallObserver observer(camera, mask, options);
  for (const LookingFrame& frame : frames) {
    if (IsStopped(stop)) return Status(StatusCode::kCancelled, "stopped");
    observer.Observe(frame.cam_from_map, frame.time_s, &grid);
  }
  coverage.whole = CoverageOf(grid, grid.first_claimed_row(), grid.end_claimed_row());
  coverage.segments = CoverageOfSegments(grid, options.segment_radii);
  return coverage;
}

}  // namespace haustra::surface
