#include <cmath>

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"
#include "tools/evaluate/colmap_reader.h"
#include "tools/report/map_model.h"

namespace haustra::test {

namespace {

void TryGeometry(const std::string& folder) {
  const Result<evaluate::MapGeometry> geometry = evaluate::ReadColmapGeometry(folder);
  if (!geometry.ok()) {
    HAUSTRA_CHECK(!geometry.status().message().empty());
    return;
  }
  const CameraCalibration& camera = geometry->camera;
  HAUSTRA_CHECK(camera.width_px > 0 && camera.height_px > 0);
  for (const double number : {camera.fx, camera.fy, camera.cx, camera.cy}) HAUSTRA_CHECK(std::isfinite(number));
  HAUSTRA_CHECK(std::isfinite(geometry->depth_mu) && geometry->depth_mu >= 0.0);
  for (const auto& [keyframe_id, depth_mu] : geometry->keyframe_depth_mu) {
    HAUSTRA_CHECK(keyframe_id >= 0 && std::isfinite(depth_mu) && depth_mu >= 0.0);
  }
}

void TryModel(const std::string& folder) {
  const Result<report::MapModel> model = report::ReadMapModel(folder);
  if (!model.ok()) {
    HAUSTRA_CHECK(!model.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(model->points.size() == model->point_ids.size() && model->points.size() == model->rgb.size());
  for (const Eigen::Vector3d& point : model->points) HAUSTRA_CHECK(point.allFinite());
  for (const auto& [keyframe_id, keyframe] : model->keyframes) {
    HAUSTRA_CHECK(keyframe_id >= 0 && std::abs(keyframe.cam_from_map.rotation.norm() - 1.0) < 1e-9);
    for (const auto& [point_id, pixel] : keyframe.pixels) HAUSTRA_CHECK(point_id >= 0 && pixel.allFinite());
  }
}

}  // namespace

// The two readers of what a run exports.
void FuzzColmap(std::span<const std::uint8_t> bytes) {
  const MemoryFolder folder(bytes, {"cameras.txt", "images.txt", "points3D.txt"});
  TryGeometry(folder.path());
  TryModel(folder.path());
}

}  // namespace haustra::test
