#include "engine/coverage/wall_observer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra {
namespace {

// The line of sight leaves the wall's own cell before it is asked whether the wall hides it.
constexpr double kLeaveCells = 1.5;
// The wall is known to about this share of the radius; what lies deeper in it is behind it.
constexpr double kSlackShare = 0.04;
// Within the lumen's bend the way along the line is longer than the line of sight.
constexpr double kLongestWay = 1.6;

}  // namespace

WallObserver::WallObserver(const CameraModel& camera, ImageView mask, const CoverageOptions& options)
    : camera_(camera), options_(options) {
  if (mask.data == nullptr) return;
  for (int y = 0; y < camera.height_px(); ++y) {
    const std::uint8_t* row = mask.row(y);
    for (int x = 0; x < camera.width_px(); ++x) is_scene_.push_back(row[x] == 255 ? 1 : 0);
  }
}

bool WallObserver::IsInPicture(const Eigen::Vector3d& point_in_cam) const {
  Eigen::Vector2d pixel;
  if (!camera_.Project(point_in_cam, &pixel) || !camera_.IsInImage(pixel)) return false;
  if (is_scene_.empty()) return true;
  const auto x = static_cast<std::size_t>(std::lround(pixel.x())), y = static_cast<std::size_t>(std::lround(pixel.y()));
  return is_scene_[y * static_cast<std::size_t>(camera_.width_px()) + x] != 0;
}

bool WallObserver::IsHidden(const WallGrid& grid, const Eigen::Vector3d& point_in_map, double length_mu,
                            const Eigen::Vector3d& centre_in_map) const {
  const Eigen::Vector3d way = centre_in_map - point_in_map;
  const double range = way.norm(), step = grid.step_mu();
  const Eigen::Vector3d direction = way / range;
  const double slack = kSlackShare * grid.lumen().radius_mu;
  double length = length_mu;
  for (double at = kLeaveCells * step; at < range; at += step) {
    const WallCoordinates place = grid.lumen().line.From(point_in_map + at * direction, length);
    length = place.length_mu;
    if (place.radius_mu > grid.RadiusAt(length, place.angle_rad) + slack) return true;
  }
  return false;
}

void WallObserver::Observe(const SE3& cam_from_map, double time_s, WallGrid* grid) const {
  const Lumen& lumen = grid->lumen();
  const double far = options_.far_radii * lumen.radius_mu, near = options_.max_range_radii * lumen.radius_mu;
  const double min_cosine = std::cos(options_.max_slant_deg * std::numbers::pi / 180.0);
  const Eigen::Vector3d centre = cam_from_map.InverseTranslation();
  const double at = lumen.line.Of(centre).length_mu;
  const int reach = static_cast<int>(std::ceil(kLongestWay * far / grid->step_mu()));
  const int here = static_cast<int>(std::floor(at / grid->step_mu()));
  const int first = std::max(here - reach, grid->first_claimed_row());
  const int end = std::min(here + reach + 1, grid->end_claimed_row());
  for (int row = first; row < end; ++row) {
    for (int column = 0; column < WallGrid::kAngles; ++column) {
      WallCell& cell = grid->cell(row, column);
      if (!cell.is_known && !cell.is_bridged) continue;
      const WallPoint point = grid->PointOf(row, column);
      const Eigen::Vector3d ray = point.position_in_map - centre;
      const double range = ray.norm();
      if (!(range > 0.0 && range <= far)) continue;
      const double cosine = -ray.dot(point.normal_in_map) / range;
      if (cosine <= 0.0) continue;
      const WallView view = range <= near && cosine >= min_cosine ? WallView::kWell : WallView::kPoorly;
      if (view < cell.view || !IsInPicture(cam_from_map * point.position_in_map)) continue;
      if (IsHidden(*grid, point.position_in_map, grid->LengthOf(row), centre)) continue;
      if (view > cell.view) cell.first_s = time_s;
      cell.view = view;
      cell.last_s = time_s;
    }
  }
}

}  // namespace haustra
