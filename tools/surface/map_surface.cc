#include "tools/surface/map_surface.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "engine/surface/depth_fusion.h"
#include "engine/surface/depth_matcher.h"
#include "platform/assemble.h"
#include "tools/command/parallel_for.h"

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
    Status matched;
    double match_ms = 0.0;
    bool has_depth() const { return matched.ok(); }
  };
  std::vector<Work> works;
  std::vector<SeeingView> views;
  for (const SurfaceKeyframe& keyframe : map.keyframes) {
    const auto picture = pictures.by_name.find(keyframe.image_name);
    if (picture == pictures.by_name.end()) {
      ++surface.num_without_picture;
      continue;
    }
    works.push_back({&keyframe, &picture->second, {}, {}, Status::Ok()});
    views.push_back(keyframe.view);
  }
  const int count = static_cast<int>(works.size());
  const int num_threads = std::max(1, options.num_threads);
  std::vector<std::unique_ptr<DepthMatcher>> matchers(num_threads);
  matchers[0] = std::make_unique<DepthMatcher>(camera, pictures.mask.view(), options.depth);
  HAUSTRA_ASSIGN(const std::unique_ptr<DepthSolver> solver,
                 CreateDepthSolver(options.device, matchers[0]->solver_plan()));
  if (solver) matchers[0]->SearchOn(solver.get());
  ParallelFor(count, solver ? 1 : num_threads, [&](int i, int worker) {
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
    const std::vector<DepthSeed> seeds = SeedsOf(*work.keyframe, matcher);
    const auto begin = std::chrono::steady_clock::now();
    work.matched = matcher.Match(reference, sources, seeds, &work.raw);
    work.match_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  });
  std::vector<double> match_ms;
  for (const Work& work : works) {
    if (work.matched.code() == StatusCode::kUnavailable) return work.matched;
    if (work.has_depth()) match_ms.push_back(work.match_ms);
  }
  if (!match_ms.empty()) {
    const auto middle = match_ms.begin() + static_cast<std::ptrdiff_t>(match_ms.size() / 2);
    std::nth_element(match_ms.begin(), middle, match_ms.end());
    surface.match_ms = *middle;
  }
  std::vector<KeyframeDepth> depths(count);
  ParallelFor(count, num_threads, [&](int i, int) {
    const Work& work = works[i];
    if (!work.has_depth()) return;
    std::vector<PosedDepth> others;
    for (int j = 0; j < count; ++j) {
      const std::vector<int>& sources = works[j].sources;
      const bool is_source = std::find(work.sources.begin(), work.sources.end(), j) != work.sources.end() ||
                             std::find(sources.begin(), sources.end(), i) != sources.end();
      if (is_source && works[j].has_depth()) others.push_back({&works[j].raw, works[j].keyframe->cam_from_map});
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
