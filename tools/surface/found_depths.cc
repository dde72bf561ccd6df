#include "tools/surface/found_depths.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <span>
#include <utility>

#include "capture/files/whole_file.h"
#include "engine/depth/depth_file.h"
#include "engine/surface/depth_matcher.h"
#include "hal/core/median.h"
#include "platform/assemble.h"
#include "tools/command/parallel_for.h"
#include "tools/run/map_name.h"

namespace haustra::surface {
namespace {

// Points of a keyframe on the grid of its depth map.
std::vector<DepthSeed> SeedsOf(const SurfaceKeyframe& keyframe, int step_px) {
  std::vector<DepthSeed> seeds;
  for (std::size_t i = 0; i < keyframe.pixels.size(); ++i) {
    DepthSeed seed;
    const Eigen::Vector3d point_in_cam = keyframe.cam_from_map * keyframe.view.points[i].position_in_map;
    if (MakeSeed(keyframe.pixels[i], step_px, point_in_cam, &seed)) seeds.push_back(seed);
  }
  return seeds;
}

std::string FileOf(const evaluate::RunOutput& run, const SurfaceMap& map) {
  return (std::filesystem::path(run.folder) / "maps" / MapName(map.map_id) / "depth.bin").string();
}

}  // namespace

Result<FoundDepths> SearchDepths(const SurfaceMap& map, const KeyframePictures& pictures, const DepthOptions& options,
                                 const std::string& device, int num_threads) {
  HAUSTRA_TRY(options.Validate());
  HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(map.camera));
  FoundDepths found;
  found.step_px = options.step_px;
  struct Work {
    const SurfaceKeyframe* keyframe;
    const KeyframePicture* picture;
    std::vector<int> sources;  // among the works
    DepthMap raw;
    Status matched;
    double match_ms = 0.0;
  };
  std::vector<Work> works;
  std::vector<SeeingView> views;
  for (const SurfaceKeyframe& keyframe : map.keyframes) {
    const auto picture = pictures.by_name.find(keyframe.image_name);
    if (picture == pictures.by_name.end()) {
      ++found.num_without_picture;
      continue;
    }
    works.push_back({&keyframe, &picture->second, {}, {}, Status::Ok()});
    views.push_back(keyframe.view);
  }
  std::vector<std::unique_ptr<DepthMatcher>> matchers(std::max(1, num_threads));
  matchers[0] = std::make_unique<DepthMatcher>(camera, pictures.mask.view(), options);
  HAUSTRA_ASSIGN(const std::unique_ptr<DepthSolver> solver, CreateDepthSolver(device, matchers[0]->solver_plan()));
  if (solver) matchers[0]->SearchOn(solver.get());
  ParallelFor(static_cast<int>(works.size()), solver ? 1 : std::max(1, num_threads), [&](int i, int worker) {
    if (!matchers[worker]) {
      matchers[worker] = std::make_unique<DepthMatcher>(camera, pictures.mask.view(), options);
    }
    DepthMatcher& matcher = *matchers[worker];
    Work& work = works[i];
    work.sources = SelectSources(views, i, options.max_sources, kMinSourceScore);
    std::vector<DepthView> sources;
    for (const int s : work.sources) {
      sources.push_back({works[s].picture->grey.view(), works[s].keyframe->cam_from_map});
    }
    work.raw = DepthMap(matcher.width(), matcher.height());
    const DepthView reference{work.picture->grey.view(), work.keyframe->cam_from_map};
    const std::vector<DepthSeed> seeds = SeedsOf(*work.keyframe, options.step_px);
    const auto begin = std::chrono::steady_clock::now();
    work.matched = matcher.Match(reference, sources, seeds, &work.raw);
    work.match_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  });
  std::vector<double> match_ms;
  for (Work& work : works) {
    if (work.matched.code() == StatusCode::kUnavailable) return work.matched;
    if (!work.matched.ok()) {
      ++found.num_without_depth;
      continue;
    }
    match_ms.push_back(work.match_ms);
    FoundDepth& depth = found.depths.emplace_back();
    depth.keyframe = work.keyframe;
    depth.frame_idx = work.picture->frame_idx;
    depth.stored_frame = work.picture->stored_frame;
    depth.raw = std::move(work.raw);
    depth.colour = work.picture->colour;
  }
  found.match_ms = UpperMedian(std::span<double>(match_ms));
  return found;
}

Result<FoundDepths> ReadKeptDepths(const evaluate::RunOutput& run, const SurfaceMap& map) {
  const std::string path = FileOf(run, map);
  HAUSTRA_ASSIGN(const std::vector<std::uint8_t> bytes, ReadWholeFile(path));
  Result<DepthFile> file = ReadDepthFile(bytes);
  if (!file.ok()) return Status(file.code(), path + ": " + file.status().message());
  const DepthGrid& grid = file->grid;
  if (grid.width != map.camera.width_px / grid.step_px || grid.height != map.camera.height_px / grid.step_px) {
    return InvalidArgument(path + ": a grid of " + std::to_string(grid.width) + "x" + std::to_string(grid.height) +
                           " cells is not that of this run's camera");
  }
  FoundDepths found;
  found.step_px = grid.step_px;
  auto saved = file->keyframes.begin();
  for (int i = 0; i < static_cast<int>(map.keyframes.size()); ++i) {
    const SurfaceKeyframe& keyframe = map.keyframes[i];
    while (saved != file->keyframes.end() && saved->keyframe_id < keyframe.keyframe_id) ++saved;
    if (saved == file->keyframes.end() || saved->keyframe_id != keyframe.keyframe_id) {
      ++found.num_without_depth;
      continue;
    }
    FoundDepth& depth = found.depths.emplace_back();
    depth.keyframe = &keyframe;
    depth.frame_idx = saved->frame_index;
    depth.stored_frame = run.figures.part.StoredFrame(depth.frame_idx);
    depth.raw = std::move(saved->depth);
    depth.colour.Resize(grid.width, grid.height, PixelFormat::kBgr8);
    for (int y = 0; y < grid.height; ++y) {
      std::copy_n(saved->bgr.begin() + std::ptrdiff_t{3} * grid.width * y, 3 * grid.width, depth.colour.row(y));
    }
  }
  return found;
}

bool HasKeptDepths(const evaluate::RunOutput& run, const std::vector<SurfaceMap>& maps) {
  return std::any_of(maps.begin(), maps.end(),
                     [&](const SurfaceMap& map) { return std::filesystem::exists(FileOf(run, map)); });
}

}  // namespace haustra::surface
