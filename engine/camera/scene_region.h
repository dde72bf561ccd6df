// Where pictures show the scene: in the image, and within the scope's window where a static mask says what that is.
// What lies outside is a border that shows nothing, whatever the camera model says of it. Without a mask the size of
// the window is learnt from the pictures. Everything but Observe: reentrant, rt-safe after construction.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/camera/lit_window.h"
#include "hal/core/memory_arena.h"
#include "hal/core/views.h"

namespace haustra {

class SceneRegion {
 public:
  // mask: 255 where pictures show the scene, kGrey8, of the camera's size, copied; empty, or 0 all over: everywhere.
  SceneRegion(const CameraModel& camera, ImageView mask,
              std::pmr::memory_resource* memory = std::pmr::get_default_resource());
  static constexpr std::size_t BytesFor(int width_px, int height_px) {
    return MemoryArena::BytesFor<std::uint64_t>(NumWords(width_px, height_px));
  }

  // Learns from one picture more; nothing where there is a mask. Tracking thread.
  void Observe(const ImageView& image, TimePoint time);

  bool has_mask() const { return has_mask_; }
  // Of the pixel that is nearest; without a mask everywhere in the image.
  bool Shows(const Eigen::Vector2d& pixel) const;
  // Part of the image's area, (0, 1].
  double share() const { return share_.load(std::memory_order_relaxed); }
  // Of the points in it: EllipseSpread (geometry/ellipse_spread.h) as a share not of the image but of the window.
  double Spread(std::span<const Eigen::Vector2d> pixels) const;

 private:
  static constexpr std::size_t NumWords(int width_px, int height_px) {
    return (static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px) + 63) / 64;
  }

  int width_px_;
  int height_px_;
  bool has_mask_ = false;
  LitWindow lit_;
  std::atomic<double> share_ = 1.0;
  std::pmr::vector<std::uint64_t> shows_;  // a bit for each pixel, row by row
};

}  // namespace haustra
