#include "engine/camera/dark_surround.h"

#include "engine/camera/lit_window.h"

namespace haustra {
namespace {

// Of the four pixels in the middle of a cell; in a small picture the same one may come twice.
bool IsDark(const ImageView& image, int cell_x, int cell_y, int num_cells) {
  const int x = (2 * cell_x + 1) * image.width / (2 * num_cells);
  const int y = (2 * cell_y + 1) * image.height / (2 * num_cells);
  const int left = x > 0 ? x - 1 : 0, above = y > 0 ? y - 1 : 0;
  return LitValue(image, x, y) + LitValue(image, left, y) + LitValue(image, x, above) + LitValue(image, left, above) <
         4 * kDarkThreshold;
}

}  // namespace

DarkSurround::DarkSurround(const ImageView& image) : width_px_(image.width), height_px_(image.height) {
  if (image.is_empty()) return;
  GoInFromEdges(kSide, kSide, [&](int x, int y) {
    if (!IsDark(image, x, y, kSide)) return false;
    rows_[static_cast<std::size_t>(y)] |= std::uint64_t{1} << x;
    return true;
  });
}

bool DarkSurround::Holds(const Eigen::Vector2d& pixel) const {
  // Pixel centres lie at integers.
  const double x = (pixel.x() + 0.5) / width_px_, y = (pixel.y() + 0.5) / height_px_;
  if (!(x >= 0.0 && x < 1.0 && y >= 0.0 && y < 1.0)) return false;
  return (rows_[static_cast<std::size_t>(y * kSide)] >> static_cast<int>(x * kSide) & 1) != 0;
}

}  // namespace haustra
