#include "platform/publish/depth_publisher.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace haustra {
namespace {

// The C header cannot include hal, so it repeats the kinds.
static_assert(static_cast<int>(CameraModelKind::kPinhole) == HAUSTRA_CAMERA_PINHOLE);
static_assert(static_cast<int>(CameraModelKind::kKannalaBrandt) == HAUSTRA_CAMERA_KANNALA_BRANDT);
static_assert(static_cast<int>(CameraModelKind::kOcamCalib) == HAUSTRA_CAMERA_OCAM_CALIB);

// Two inverse ranges that differ by more do not lie on one wall.
constexpr double kMaxRatio = 1.1;

haustra_depth_camera CameraRecord(const CameraCalibration& calibration, ImageView mask, int depth_step_px) {
  haustra_depth_camera camera{};
  camera.model = static_cast<std::uint32_t>(calibration.kind);
  camera.width_px = static_cast<std::uint32_t>(calibration.width_px);
  camera.height_px = static_cast<std::uint32_t>(calibration.height_px);
  const int width = calibration.width_px / depth_step_px, height = calibration.height_px / depth_step_px;
  const int step = PublishedCellStep(width, height);
  const int step_px = step * depth_step_px;
  camera.step_px = static_cast<std::uint32_t>(step_px);
  camera.grid_width = static_cast<std::uint32_t>(width / step);
  camera.grid_height = static_cast<std::uint32_t>(height / step);
  camera.fx = calibration.fx;
  camera.fy = calibration.fy;
  camera.cx = calibration.cx;
  camera.cy = calibration.cy;
  std::copy(calibration.coefficients.begin(), calibration.coefficients.end(), camera.coefficients);
  camera.max_half_angle_deg = calibration.max_half_angle_deg;
  std::uint8_t* cell = camera.is_scene;
  for (int y = 0; y < height / step; ++y) {
    for (int x = 0; x < width / step; ++x) {
      const bool is_scene = mask.is_empty() || mask.row(y * step_px + step_px / 2)[x * step_px + step_px / 2] == 255;
      *cell++ = is_scene ? 1 : 0;
    }
  }
  return camera;
}

// Of the published cell (x, y) the cells around its middle, one along each side of an odd step and two of an even one.
int Around(int x, int y, int step, int width, std::array<int, 4>* cells) {
  const int first = (step - 1) / 2, last = step / 2;
  int count = 0;
  for (int row = first; row <= last; ++row) {
    for (int column = first; column <= last; ++column) {
      (*cells)[static_cast<std::size_t>(count++)] = (y * step + row) * width + x * step + column;
    }
  }
  return count;
}

}  // namespace

int PublishedCellStep(int grid_width, int grid_height) {
  int step = 1;
  while ((grid_width / step) * (grid_height / step) > static_cast<int>(HAUSTRA_DEPTH_MAX_CELLS)) ++step;
  return step;
}

void FillDepth(const DepthMap& depth, std::span<const std::uint8_t> bgr, int step, haustra_depth* record) {
  const int width = depth.width() / step, height = depth.height() / step;
  const std::span<const std::uint16_t> codes = depth.codes();
  record->num_cells = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  std::size_t to = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++to) {
      std::array<int, 4> cells;
      const int count = Around(x, y, step, depth.width(), &cells);
      std::uint32_t sum = 0, lowest = 0xffff, highest = 0;
      int confidence = 255;
      std::array<std::uint32_t, 3> colour{};
      for (int i = 0; i < count; ++i) {
        const auto cell = static_cast<std::size_t>(cells[static_cast<std::size_t>(i)]);
        sum += codes[cell];
        lowest = std::min<std::uint32_t>(lowest, codes[cell]);
        highest = std::max<std::uint32_t>(highest, codes[cell]);
        confidence = std::min(confidence, depth.confidence(static_cast<int>(cell)));
        for (std::size_t c = 0; c < 3; ++c) colour[c] += bgr[3 * cell + c];
      }
      const bool is_known = lowest != DepthMap::kNoDepth && highest <= kMaxRatio * lowest;
      const auto number = static_cast<std::uint32_t>(count);
      record->codes[to] = is_known ? static_cast<std::uint16_t>((sum + number / 2) / number) : DepthMap::kNoDepth;
      record->confidences[to] = is_known ? static_cast<std::uint8_t>(confidence) : std::uint8_t{0};
      for (std::size_t c = 0; c < 3; ++c) record->bgr[3 * to + c] = static_cast<std::uint8_t>(colour[c] / number);
    }
  }
}

DepthPublisher::DepthPublisher(DepthTableWriter& table, const CameraCalibration& calibration, ImageView mask,
                               int depth_step_px, int max_keyframes)
    : table_(table),
      camera_(CameraRecord(calibration, mask, depth_step_px)),
      cell_step_(static_cast<int>(camera_.step_px) / depth_step_px),
      told_(static_cast<std::size_t>(max_keyframes)),
      is_there_(static_cast<std::size_t>(max_keyframes)),
      depth_(std::make_unique<haustra_depth>()) {}

std::size_t DepthPublisher::BytesFor(int max_keyframes) {
  return sizeof(haustra_depth_camera) + sizeof(haustra_depth) +
         static_cast<std::size_t>(max_keyframes) * (sizeof(Told) + 1);
}

void DepthPublisher::Begin(std::uint64_t procedure) {
  procedure_ = procedure;
  camera_.procedure = procedure;
  table_.Wipe();
  std::fill(told_.begin(), told_.end(), Told{});
  table_.PublishCamera(camera_);
}

bool DepthPublisher::Publish(const Engine& engine) {
  int depths_left = kDepthsAtOnce;
  bool has_more = false;
  std::fill(is_there_.begin(), is_there_.end(), false);
  engine.atlas().keyframes().ForEach([&](KeyframeHandle handle, const Keyframe&) {
    if (handle.index >= told_.size()) return;
    is_there_[handle.index] = true;
    has_more = Tell(engine, handle, &depths_left) || has_more;
  });
  for (std::uint32_t slot = 0; slot < told_.size(); ++slot) {
    if (is_there_[slot] || !told_[slot].keyframe.is_valid()) continue;
    table_.Clear(slot);
    told_[slot] = Told{};
  }
  return has_more;
}

// True: its depth has to wait.
bool DepthPublisher::Tell(const Engine& engine, KeyframeHandle handle, int* depths_left) {
  const Atlas& atlas = engine.atlas();
  const Keyframe& keyframe = atlas.keyframe(handle);
  Told& told = told_[handle.index];
  if (told.keyframe.is_valid() && told.keyframe != handle) {
    table_.Clear(handle.index);
    told = Told{};
  }
  haustra_depth_keyframe record{};
  record.procedure = procedure_;
  record.map_epoch = engine.mapper_counters().num_reframings;
  record.source_ns = keyframe.timestamp.time_since_epoch().count();
  record.keyframe_id = keyframe.id;
  record.frame_index = keyframe.frame_index;
  record.map_id = atlas.map(keyframe.map).id;
  record.is_of_this_run = atlas.IsOfThisSession(keyframe.id) ? 1 : 0;
  const SE3 map_from_cam = keyframe.cam_from_map.Inverse();
  Eigen::Map<Eigen::Vector3d>(record.position_mu) = map_from_cam.translation;
  Eigen::Map<Eigen::Vector4d>(record.orientation_xyzw) = map_from_cam.rotation.coeffs();
  record.scale = atlas.KeyframeScale(handle);
  const KeptDepth* kept = engine.depths() ? engine.depths()->DepthOf(handle) : nullptr;
  // What was told is gone when the map was built anew, also when there is another one by now.
  const std::uint64_t turned_at = kept != nullptr ? kept->turned_at : 0;
  record.depth = kept != nullptr && turned_at == told.turned_at ? told.record.depth : 0;
  bool has_to_wait = false;
  if (kept != nullptr) {
    if (record.depth == 0 && *depths_left > 0) {
      --*depths_left;
      FillDepth(kept->depth, kept->bgr, cell_step_, depth_.get());
      record.depth = table_.PublishDepth(handle.index, *depth_);
    }
    has_to_wait = record.depth == 0;
    if (record.depth != 0) {
      record.inverse_range_unit = kept->depth.unit() * kept->scale / record.scale;
    }
  }
  // By bytes, which readers get.
  // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
  if (told.keyframe == handle && std::memcmp(&told.record, &record, sizeof record) == 0) return has_to_wait;
  table_.PublishKeyframe(handle.index, record);
  told = {handle, record, turned_at};
  return has_to_wait;
}

}  // namespace haustra
