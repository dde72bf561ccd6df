#include "tools/surface/map_surface.h"

#include <algorithm>
#include <utility>

#include "engine/surface/depth_fusion.h"
#include "tools/command/parallel_for.h"

namespace haustra::surface {
namespace {

bool WasComparedWith(const FoundDepth& one, const FoundDepth& other) {
  const auto names = [](const FoundDepth& from, const FoundDepth& to) {
    return std::find(from.compared_to.begin(), from.compared_to.end(), to.keyframe->keyframe_id) !=
           from.compared_to.end();
  };
  return &one != &other && (names(one, other) || names(other, one));
}

}  // namespace

Result<MapSurface> MakeMapSurface(const SurfaceMap& map, const FoundDepths& found, const SurfaceOptions& options) {
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(map.camera));
  MapSurface surface;
  surface.step_px = found.step_px;
  surface.num_without_picture = found.num_without_picture;
  surface.num_without_depth = found.num_without_depth;
  surface.match_ms = found.match_ms;
  surface.depths.resize(found.depths.size());
  ParallelFor(static_cast<int>(found.depths.size()), std::max(1, options.num_threads), [&](int i, int) {
    if (IsStopped(options.stop)) return;
    const FoundDepth& own = found.depths[i];
    std::vector<PosedDepth> others;
    for (const FoundDepth& other : found.depths) {
      if (WasComparedWith(own, other)) others.push_back({&other.raw, other.keyframe->cam_from_map});
    }
    surface.depths[i] = {own.keyframe, own.frame_idx, own.stored_frame, DepthMap(own.raw.width(), own.raw.height())};
    CheckDepth(camera, found.step_px, {&own.raw, own.keyframe->cam_from_map}, others, options.consistency,
               &surface.depths[i].depth);
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
