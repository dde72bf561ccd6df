// What of one picture is dark from its edge on, along a row or a column: the surround of the scope's window, where no
// mask says what that is. A dark lumen within the window is none. Plain data. reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "hal/core/views.h"

namespace haustra {

// Goes from the edges of a grid inwards, along each row and each column from both of its ends, as long as
// `is_surround(x, y)`. Cells may be asked about more than once.
template <typename IsSurround>
void GoInFromEdges(int width, int height, IsSurround&& is_surround) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width && is_surround(x, y); ++x) continue;
    for (int x = width - 1; x >= 0 && is_surround(x, y); --x) continue;
  }
  for (int x = 0; x < width; ++x) {
    for (int y = 0; y < height && is_surround(x, y); ++y) continue;
    for (int y = height - 1; y >= 0 && is_surround(x, y); --y) continue;
  }
}

class DarkSurround {
 public:
  // There is none.
  DarkSurround() = default;
  // Of a picture of any format. Looks at four pixels a cell of kSide x kSide, of cells that are dark, and the first
  // that is not.
  explicit DarkSurround(const ImageView& image);

  // To a cell, the side of the picture over kSide. False outside the picture.
  bool Holds(const Eigen::Vector2d& pixel) const;

 private:
  static constexpr int kSide = 64;

  int width_px_ = 0, height_px_ = 0;
  std::array<std::uint64_t, kSide> rows_{};  // a bit for each cell
};

}  // namespace haustra
