#include "tools/view/live_surface.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "capture/codec/png_codec.h"
#include "capture/image.h"
#include "engine/io/ply_writer.h"
#include "tools/report/base64.h"
#include "tools/surface/coverage_picture.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/map_coverage.h"
#include "tools/view/seconds.h"

namespace haustra::view {
namespace {

using Json = nlohmann::ordered_json;

// Of the cells of a depth that are asked for the median.
constexpr int kCellStep = 16;

CameraCalibration CalibrationOf(const haustra_depth_camera& camera) {
  CameraCalibration calibration;
  calibration.kind = static_cast<CameraModelKind>(camera.model);
  calibration.width_px = static_cast<int>(camera.width_px);
  calibration.height_px = static_cast<int>(camera.height_px);
  calibration.fx = camera.fx;
  calibration.fy = camera.fy;
  calibration.cx = camera.cx;
  calibration.cy = camera.cy;
  std::copy_n(camera.coefficients, calibration.coefficients.size(), calibration.coefficients.begin());
  calibration.max_half_angle_deg = camera.max_half_angle_deg;
  return calibration;
}

// 255 where the picture shows the scene; empty when it does everywhere.
Image MaskOf(const haustra_depth_camera& camera) {
  const std::size_t num_cells = std::size_t(camera.grid_width) * camera.grid_height;
  if (std::find(camera.is_scene, camera.is_scene + num_cells, 0) == camera.is_scene + num_cells) return {};
  const int width = static_cast<int>(camera.width_px), height = static_cast<int>(camera.height_px);
  const int step = static_cast<int>(camera.step_px), columns = static_cast<int>(camera.grid_width);
  const int rows = static_cast<int>(camera.grid_height);
  Image mask(width, height, PixelFormat::kGrey8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int cell = std::min(y / step, rows - 1) * columns + std::min(x / step, columns - 1);
      mask.row(y)[x] = camera.is_scene[cell] != 0 ? 255 : 0;
    }
  }
  return mask;
}

surface::FoundDepth FoundDepthOf(const LiveKeyframe& live, const haustra_depth_camera& camera,
                                 const surface::SurfaceKeyframe& keyframe) {
  const int width = static_cast<int>(camera.grid_width), height = static_cast<int>(camera.grid_height);
  const std::size_t num_cells = std::size_t(width) * static_cast<std::size_t>(height);
  surface::FoundDepth found;
  found.keyframe = &keyframe;
  found.frame_idx = found.stored_frame = live.record.frame_index;
  found.raw = DepthMap(width, height);
  found.raw.Restore(live.record.inverse_range_unit, {live.depth->codes, num_cells},
                    {live.depth->confidences, num_cells});
  found.colour.Resize(width, height, PixelFormat::kBgr8);
  for (int y = 0; y < height; ++y) std::copy_n(live.depth->bgr + 3 * width * y, 3 * width, found.colour.row(y));
  return found;
}

double MedianRange(const std::vector<surface::FoundDepth>& depths) {
  std::vector<double> ranges;
  for (const surface::FoundDepth& each : depths) {
    for (int cell = 0; cell < each.raw.num_cells(); cell += kCellStep) {
      if (each.raw.has_depth(cell)) ranges.push_back(each.raw.range_mu(cell));
    }
  }
  if (ranges.empty()) return 0.0;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::nth_element(ranges.begin(), middle, ranges.end());
  return *middle;
}

// Keyframes and what lies between them, by time from the first keyframe on.
std::vector<surface::LookingFrame> FramesOf(const LiveMaps& maps) {
  std::vector<std::pair<std::int64_t, SE3>> looks;
  for (const auto& [id, keyframe] : maps.keyframes) {
    if (keyframe.record.map_id != maps.map_id || keyframe.record.is_of_this_run == 0) continue;
    looks.emplace_back(keyframe.record.source_ns, keyframe.map_from_cam.Inverse());
  }
  for (const LiveFrame& frame : maps.frames) {
    const std::optional<SE3> map_from_cam = maps.MapFromCam(frame);
    if (!map_from_cam || maps.keyframes.at(frame.keyframe_id).record.map_id != maps.map_id) continue;
    looks.emplace_back(frame.source_ns, map_from_cam->Inverse());
  }
  std::stable_sort(looks.begin(), looks.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<surface::LookingFrame> frames;
  for (const auto& [source_ns, cam_from_map] : looks) {
    frames.push_back({static_cast<double>(source_ns - looks.front().first) * 1e-9, cam_from_map});
  }
  return frames;
}

// map_from_cam: of the scope; null: it is not known in this map.
void AddPicture(const WallGrid& wall, const SE3* map_from_cam, Json* json) {
  const Image picture = surface::UnrolledPicture(wall);
  std::vector<std::uint8_t> png;
  if (picture.is_empty() || !capture::internal::EncodePng(picture.view(), &png).ok()) return;
  (*json)["picture"] = report::ToBase64(png);
  if (map_from_cam == nullptr) return;
  const double row = wall.lumen().line.Of(map_from_cam->translation).length_mu / wall.step_mu();
  (*json)["scope"] = (row - wall.first_claimed_row()) / (wall.end_claimed_row() - wall.first_claimed_row());
}

}  // namespace

Result<LiveSurface> MakeLiveSurface(const LiveMaps& maps, const surface::SurfaceOptions& options) {
  if (!maps.camera) return NotFound("no depth is published");
  const haustra_depth_camera& published = *maps.camera;
  surface::SurfaceMap map;
  map.map_id = static_cast<int>(maps.map_id);
  map.camera = CalibrationOf(published);
  std::vector<const LiveKeyframe*> with_depth;
  int num_keyframes = 0;
  // The table comes later than the poses, and may be read while it is written.
  std::uint64_t epoch = 0;
  for (const auto& [id, keyframe] : maps.keyframes) {
    if (keyframe.record.map_id != maps.map_id) continue;
    if (num_keyframes++ > 0 && keyframe.record.map_epoch != epoch) return NotFound("the map is being moved");
    epoch = keyframe.record.map_epoch;
    if (keyframe.depth == nullptr || !(keyframe.record.inverse_range_unit > 0.0)) continue;
    with_depth.push_back(&keyframe);
    surface::SurfaceKeyframe& own = map.keyframes.emplace_back();
    own.keyframe_id = id;
    own.cam_from_map = keyframe.map_from_cam.Inverse();
  }
  if (with_depth.empty()) return NotFound("no keyframe of the map has a depth yet");

  surface::FoundDepths found;
  found.step_px = static_cast<int>(published.step_px);
  for (std::size_t i = 0; i < with_depth.size(); ++i) {
    found.depths.push_back(FoundDepthOf(*with_depth[i], published, map.keyframes[i]));
  }
  map.depth_mu = MedianRange(found.depths);
  HAUSTRA_ASSIGN(const surface::MapSurface made, surface::MakeMapSurface(map, found, options));
  const Image mask = MaskOf(published);
  HAUSTRA_ASSIGN(const surface::MapCoverage coverage,
                 surface::MakeMapCoverage(map, made, FramesOf(maps), mask.view(), options.stop, {}));

  LiveSurface surface;
  if (!made.mesh.triangles.empty()) {
    StringSink ply;
    HAUSTRA_TRY(WriteMeshPly(ply, made.mesh, map.map_id));
    surface.ply = ply.bytes();
  }
  Json json = {{"map", map.map_id},
               {"epoch", epoch},
               {"t_s", Seconds(maps.captured_ns)},
               {"keyframes", num_keyframes},
               {"depths", with_depth.size()},
               {"triangles", made.mesh.triangles.size()},
               {"refused_blocks", made.num_refused_blocks}};
  surface::AddCoverage(coverage, &json);
  if (coverage.wall) AddPicture(*coverage.wall, epoch == maps.map_epoch ? &maps.map_from_cam : nullptr, &json);
  surface.json = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  return surface;
}

}  // namespace haustra::view
