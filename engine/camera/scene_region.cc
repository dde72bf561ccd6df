#include "engine/camera/scene_region.h"

#include <cmath>

#include "engine/geometry/ellipse_spread.h"
#include "hal/core/check.h"

namespace haustra {

SceneRegion::SceneRegion(const CameraModel& camera, ImageView mask, std::pmr::memory_resource* memory)
    : width_px_(camera.width_px()),
      height_px_(camera.height_px()),
      shows_(NumWords(camera.width_px(), camera.height_px()), ~std::uint64_t{0}, memory) {
  if (mask.is_empty()) return;
  HAUSTRA_CHECK(mask.width == width_px_ && mask.height == height_px_);
  std::size_t num_shown = 0, bit = 0;
  for (int y = 0; y < height_px_; ++y) {
    for (int x = 0; x < width_px_; ++x, ++bit) {
      if (mask.row(y)[x] > 127) {
        ++num_shown;
      } else {
        shows_[bit / 64] &= ~(std::uint64_t{1} << bit % 64);
      }
    }
  }
  if (num_shown == 0) {
    shows_.assign(shows_.size(), ~std::uint64_t{0});
    return;
  }
  has_mask_ = true;
  share_ = static_cast<double>(num_shown) / (static_cast<double>(width_px_) * height_px_);
}

void SceneRegion::Observe(const ImageView& image, TimePoint time) {
  if (has_mask_ || image.is_empty()) return;
  lit_.Observe(image, time);
  share_.store(lit_.share(), std::memory_order_relaxed);
}

double SceneRegion::Spread(std::span<const Eigen::Vector2d> pixels) const {
  return EllipseSpread(pixels, width_px_, height_px_) / share();
}

bool SceneRegion::Shows(const Eigen::Vector2d& pixel) const {
  const double x = std::round(pixel.x()), y = std::round(pixel.y());
  if (!(x >= 0.0 && y >= 0.0 && x <= width_px_ - 1 && y <= height_px_ - 1)) return false;
  const std::size_t bit =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px_) + static_cast<std::size_t>(x);
  return (shows_[bit / 64] >> bit % 64 & 1) != 0;
}

}  // namespace haustra
