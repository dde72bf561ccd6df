#include "tools/surface/depth_truth.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "engine/camera/camera_model.h"
#include "engine/surface/depth_seeds.h"
#include "tools/command/range_picture.h"
#include "tools/evaluate/statistics.h"

namespace haustra::surface {
namespace {

constexpr double kSameWall = 0.05;  // relative difference of true ranges up to which two keyframes see one wall

struct TrueView {
  const KeyframeDepth* answer;
  SE3 world_from_cam;
  RangePicture range;
};

// On cells of so many of the truth's: the mean of those that it covers where they lie on one wall, else nothing. The
// ray of a cell is that of its middle, and so is the mean.
RangePicture OnCoarserCells(const RangePicture& fine, int factor) {
  RangePicture coarse;
  coarse.width = fine.width / factor;
  coarse.height = fine.height / factor;
  for (int i = 0; i < coarse.width * coarse.height; ++i) {
    const int x = i % coarse.width * factor, y = i / coarse.width * factor;
    double sum = 0.0, least = std::numeric_limits<double>::infinity(), most = 0.0;
    for (int k = 0; k < factor * factor; ++k) {
      const double range = fine.range_mm[std::size_t(y + k / factor) * fine.width + x + k % factor];
      sum += range;
      least = std::min(least, range);
      most = std::max(most, range);
    }
    const bool is_one_wall = least > 0.0 && most - least <= kSameWall * most;
    coarse.range_mm.push_back(static_cast<float>(is_one_wall ? sum / (factor * factor) : 0.0));
  }
  return coarse;
}

struct Errors {
  std::vector<double> relative, absolute_mm;
};

// Whether another keyframe sees the point under enough of an angle.
bool IsSeenTwice(const CameraModel& camera, int step_px, const std::vector<TrueView>& views, std::size_t own,
                 const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d ray = point_in_world - views[own].world_from_cam.translation;
  for (std::size_t j = 0; j < views.size(); ++j) {
    if (j == own) continue;
    const TrueView& other = views[j];
    const Eigen::Vector3d other_ray = point_in_world - other.world_from_cam.translation;
    const double angle = std::atan2(ray.cross(other_ray).norm(), ray.dot(other_ray));
    if (angle * 180.0 / std::numbers::pi <= kMinAngleDeg) continue;
    Eigen::Vector2d pixel;
    if (!camera.Project(other.world_from_cam.Inverse() * point_in_world, &pixel)) continue;
    const Eigen::Vector2d cell = CellOfPixel(pixel, step_px).array().round();
    if (!(cell.x() >= 0.0 && cell.y() >= 0.0 && cell.x() < other.range.width && cell.y() < other.range.height))
      continue;
    const double seen =
        other.range
            .range_mm[static_cast<std::size_t>(cell.y()) * other.range.width + static_cast<std::size_t>(cell.x())];
    if (std::abs(seen - other_ray.norm()) <= kSameWall * other_ray.norm()) return true;
  }
  return false;
}

void JudgeMap(const CameraModel& camera, int step_px, double mm_per_mu, const std::vector<TrueView>& views,
              DepthScore* score, Errors* errors) {
  for (std::size_t v = 0; v < views.size(); ++v) {
    const TrueView& view = views[v];
    ++score->keyframes;
    for (int i = 0; i < view.range.width * view.range.height; ++i) {
      const double truth_mm = view.range.range_mm[i];
      if (truth_mm <= 0.0) continue;
      ++score->known_cells;
      Eigen::Vector3d bearing;
      if (!camera.Unproject({CellCentrePx(i % view.range.width, step_px), CellCentrePx(i / view.range.width, step_px)},
                            &bearing)) {
        continue;
      }
      if (!IsSeenTwice(camera, step_px, views, v, view.world_from_cam * Eigen::Vector3d(truth_mm * bearing))) continue;
      ++score->seen_cells;
      if (!view.answer->depth.has_depth(i)) continue;
      ++score->answered_cells;
      const double error_mm = std::abs(mm_per_mu * view.answer->depth.range_mu(i) - truth_mm);
      errors->absolute_mm.push_back(error_mm);
      errors->relative.push_back(error_mm / truth_mm);
    }
  }
}

std::string TruePath(const std::string& folder, std::int64_t frame) {
  char name[40];
  std::snprintf(name, sizeof(name), "/%06lld.pgm", static_cast<long long>(frame));
  return folder + name;
}

}  // namespace

Result<std::optional<DepthScore>> JudgeDepths(const std::vector<SurfaceMap>& maps,
                                              const std::vector<MapSurface>& surfaces, const evaluate::RunOutput& run,
                                              const evaluate::Evaluation& evaluation,
                                              const evaluate::Reference& reference, const std::string& truth) {
  const std::vector<std::optional<SE3>> poses = evaluate::Associate(run.frames, reference.poses);
  DepthScore score;
  Errors errors;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto map = std::find_if(evaluation.per_map.begin(), evaluation.per_map.end(),
                                  [&](const evaluate::MapEvaluation& each) { return each.map_id == maps[m].map_id; });
    if (map == evaluation.per_map.end() || !map->truth_from_map) continue;
    HAUSTRA_ASSIGN(const CameraModel camera, CameraModel::Create(maps[m].camera));
    const int step_px = surfaces[m].step_px;
    std::vector<TrueView> views;
    for (const KeyframeDepth& depth : surfaces[m].depths) {
      const auto row =
          std::lower_bound(run.frames.begin(), run.frames.end(), depth.frame_idx,
                           [](const evaluate::RunFrame& f, std::int64_t idx) { return f.frame_idx < idx; });
      if (row == run.frames.end() || row->frame_idx != depth.frame_idx) continue;
      const std::optional<SE3>& pose = poses[row - run.frames.begin()];
      if (!pose) continue;
      const std::string path = TruePath(truth, depth.stored_frame);
      HAUSTRA_ASSIGN(RangePicture range, ReadRangePicture(path));
      if (step_px % RangePicture::kStepPx != 0) {
        return InvalidArgument(path + ": is of " + std::to_string(RangePicture::kStepPx) +
                               " pixels a cell, the depth of the run of " + std::to_string(step_px));
      }
      if (step_px > RangePicture::kStepPx) range = OnCoarserCells(range, step_px / RangePicture::kStepPx);
      if (range.width != depth.depth.width() || range.height != depth.depth.height()) {
        return InvalidArgument(path + ": has " + std::to_string(range.width) + "x" + std::to_string(range.height) +
                               " values, the depth of the run " + std::to_string(depth.depth.width()) + "x" +
                               std::to_string(depth.depth.height()));
      }
      views.push_back({&depth, *pose, std::move(range)});
    }
    JudgeMap(camera, step_px, map->truth_from_map->scale, views, &score, &errors);
  }
  if (score.keyframes == 0) return std::optional<DepthScore>();
  const auto share = [&](double limit) {
    const auto count =
        std::count_if(errors.relative.begin(), errors.relative.end(), [&](double e) { return e <= limit; });
    return errors.relative.empty() ? 0.0 : static_cast<double>(count) / static_cast<double>(errors.relative.size());
  };
  score.within_2 = share(0.02);
  score.within_5 = share(0.05);
  score.within_10 = share(0.10);
  double squares = 0.0;
  for (const double error : errors.absolute_mm) squares += error * error;
  if (!errors.relative.empty()) {
    score.rms_mm = std::sqrt(squares / static_cast<double>(errors.absolute_mm.size()));
    score.median_error = evaluate::Median(std::move(errors.relative));
    score.median_mm = evaluate::Median(std::move(errors.absolute_mm));
  }
  return std::optional<DepthScore>(score);
}

}  // namespace haustra::surface
