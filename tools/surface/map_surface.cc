#include "tools/surface/map_surface.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "engine/surface/depth_fusion.h"
#include "engine/surface/depth_matcher.h"
#include "tools/render/parallel_for.h"

namespace haustra::surface {
namespace {

// Of SelectSources: what a dozen well-placed points count.
constexpr double kMinScore = 10.0;

// Points of a keyframe on the grid of its depth map.
std::vector<DepthSeed> SeedsOf(const SurfaceKeyframe& keyframe, const DepthMatcher& matcher) {
  std::vector<DepthSeed> seeds;
  for (std::size_t i = 0; i < keyframe.pixels.size(); ++i) {
    const Eigen::Vector3d point_in_cam = keyframe.cam_from_map * keyframe.view.points[i].position_in_map;
    const double range = point_in_cam.norm();
    if (!(range > 0.0)) continue;
    seeds.push_back({matcher.CellOfPixel(keyframe.pixels[i]), point_in_cam / range, 1.0 / range});
  }
  return seeds;
}

}  // namespace

Result<MapSurface> MakeMapSurface(const SurfaceMap& map, const KeyframePictures& pictures,
                                  const SurfaceOptions& options) {
  HAUSTRA_TRY(options.depth.Validate());
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(map.camera));
  MapSurface surface;
  struct Work {
    const SurfaceKeyframe* keyframe;
    const KeyframePicture* picture;
    std::vector<int> sources;  // among the works
    DepthMap raw;
    bool has_depth = false;
  };
  std::vector<Work> works;
  std::vector<SeeingView> views;
  for (const SurfaceKeyframe& keyframe : map.keyframes) {
    const auto picture = pictures.by_name.find(keyframe.image_name);
    if (picture == pictures.by_name.end()) {
      ++surface.num_without_picture;
      continue;
    }
    works.push_back({&keyframe, &picture->second, {}, {}});
    views.push_back(keyframe.view);
  }
  const int count = static_cast<int>(works.size());
  std::vector<std::unique_ptr<DepthMatcher>> matchers(std::max(1, options.num_threads));
  render::ParallelFor(count, static_cast<int>(matchers.size()), [&](int i, int worker) {
    if (!matchers[worker]) {
      matchers[worker] = std::make_unique<DepthMatcher>(camera, pictures.mask.view(), options.depth);
    }
    DepthMatcher& matcher = *matchers[worker];
    Work& work = works[i];
    work.sources = SelectSources(views, i, options.depth.max_sources, kMinScore);
    std::vector<DepthView> sources;
    for (const int s : work.sources) {
      sources.push_back({works[s].picture->grey.view(), works[s].keyframe->cam_from_map});
    }
    work.raw = DepthMap(matcher.width(), matcher.height());
    const DepthView reference{work.picture->grey.view(), work.keyframe->cam_from_map};
    work.has_depth = matcher.Match(reference, sources, SeedsOf(*work.keyframe, matcher), &work.raw).ok();
  });
  std::vector<KeyframeDepth> depths(count);
  render::ParallelFor(count, static_cast<int>(matchers.size()), [&](int i, int) {
    const Work& work = works[i];
    if (!work.has_depth) return;
    std::vector<PosedDepth> others;
    for (int j = 0; j < count; ++j) {
      const std::vector<int>& sources = works[j].sources;
      const bool is_source = std::find(work.sources.begin(), work.sources.end(), j) != work.sources.end() ||
                             std::find(sources.begin(), sources.end(), i) != sources.end();
      if (is_source && works[j].has_depth) others.push_back({&works[j].raw, works[j].keyframe->cam_from_map});
    }
    depths[i] = {work.keyframe, work.picture, DepthMap(work.raw.width(), work.raw.height())};
    CheckDepth(camera, options.depth.step_px, {&work.raw, work.keyframe->cam_from_map}, others, options.consistency,
               &depths[i].depth);
  });
  FusionOptions fusion_options;
  surface.voxel_mu = fusion_options.voxel_mu = options.voxel_share * map.depth_mu;
  if (!(surface.voxel_mu > 0.0)) return surface;
  DepthFusion fusion(camera, options.depth.step_px, fusion_options, options.max_blocks);
  for (KeyframeDepth& depth : depths) {
    if (depth.keyframe == nullptr) {
      ++surface.num_without_depth;
      continue;
    }
    fusion.Integrate(depth.depth, depth.picture->colour.view(), depth.keyframe->cam_from_map);
    surface.depths.push_back(std::move(depth));
  }
  surface.num_blocks = fusion.blocks().num_blocks();
  surface.num_refused_blocks = fusion.blocks().num_refused();
  surface.mesh = ExtractMesh(fusion.blocks(), surface.voxel_mu, options.mesh);
  return surface;
}

}  // namespace haustra::surface
