#include "engine/calibration/scope_window.h"

#include <algorithm>

#include "engine/camera/lit_window.h"

namespace haustra::calibration {
namespace {

constexpr int kStep = 2;
constexpr double kMinShare = 0.15;  // of a row or column that must have been bright: letters beside the window are less
constexpr double kCornerShare = 0.06;  // side of the square that is looked at, share of the shorter side
constexpr int kMinDarkCorners = 3;     // text may stand in the fourth

// Inclusive bounds.
struct Bounds {
  int left = 0, right = 0, top = 0, bottom = 0;
};

ScopeWindow WindowOf(const Bounds& b) {
  return {0.5 * (b.left + b.right), 0.5 * (b.top + b.bottom), b.right - b.left + 1.0, b.bottom - b.top + 1.0, false};
}

// `is_bright(x, y)` within the bounds.
template <typename IsBright>
bool IsCut(const Bounds& b, const IsBright& is_bright) {
  const int side = static_cast<int>(kCornerShare * (1 + std::min(b.right - b.left, b.bottom - b.top)));
  if (side < 1) return false;
  int num_dark = 0;
  for (const int left : {b.left, b.right - side + 1}) {
    for (const int top : {b.top, b.bottom - side + 1}) {
      int num_bright = 0;
      for (int y = top; y < top + side; ++y) {
        for (int x = left; x < left + side; ++x) num_bright += is_bright(x, y);
      }
      num_dark += 2 * num_bright < side * side;
    }
  }
  return num_dark >= kMinDarkCorners;
}

}  // namespace

ScopeWindowFinder::ScopeWindowFinder(int width_px, int height_px)
    : width_px_(width_px),
      height_px_(height_px),
      num_columns_((width_px + kStep - 1) / kStep),
      num_rows_((height_px + kStep - 1) / kStep),
      brightest_(static_cast<std::size_t>(num_columns_) * static_cast<std::size_t>(num_rows_), 0) {}

void ScopeWindowFinder::Add(const ImageView& image) {
  std::size_t i = 0;
  for (int y = 0; y < num_rows_; ++y) {
    for (int x = 0; x < num_columns_; ++x, ++i) {
      brightest_[i] = std::max(brightest_[i], static_cast<std::uint8_t>(LitValue(image, kStep * x, kStep * y)));
    }
  }
}

ScopeWindow ScopeWindowFinder::Find() const {
  std::vector<int> in_row(static_cast<std::size_t>(num_rows_), 0), in_column(static_cast<std::size_t>(num_columns_), 0);
  std::size_t i = 0;
  for (int y = 0; y < num_rows_; ++y) {
    for (int x = 0; x < num_columns_; ++x, ++i) {
      if (brightest_[i] < kLitThreshold) continue;
      ++in_row[y];
      ++in_column[x];
    }
  }
  const auto ends = [](const std::vector<int>& counts, int full, int* first, int* last) {
    *first = -1;
    for (int k = 0; k < static_cast<int>(counts.size()); ++k) {
      if (counts[k] < kMinShare * full) continue;
      if (*first < 0) *first = k;
      *last = k;
    }
    return *first >= 0;
  };
  int left = 0, right = 0, top = 0, bottom = 0;
  if (!ends(in_column, num_rows_, &left, &right) || !ends(in_row, num_columns_, &top, &bottom)) {
    return WindowOf({0, width_px_ - 1, 0, height_px_ - 1});
  }
  ScopeWindow window = WindowOf({kStep * left, std::min(width_px_ - 1, kStep * right + kStep - 1), kStep * top,
                                 std::min(height_px_ - 1, kStep * bottom + kStep - 1)});
  window.is_cut = IsCut({left, right, top, bottom}, [this](int x, int y) {
    return brightest_[static_cast<std::size_t>(y) * static_cast<std::size_t>(num_columns_) +
                      static_cast<std::size_t>(x)] >= kLitThreshold;
  });
  return window;
}

ScopeWindow ScopeWindowFinder::OfMask(const ImageView& mask, int width_px, int height_px) {
  int left = width_px, right = -1, top = height_px, bottom = -1;
  if (!mask.is_empty()) {
    for (int y = 0; y < mask.height; ++y) {
      for (int x = 0; x < mask.width; ++x) {
        if (mask.row(y)[x] < 128) continue;
        left = std::min(left, x);
        right = std::max(right, x);
        top = std::min(top, y);
        bottom = std::max(bottom, y);
      }
    }
  }
  if (right < 0) return WindowOf({0, width_px - 1, 0, height_px - 1});
  ScopeWindow window = WindowOf({left, right, top, bottom});
  window.is_cut = IsCut({left, right, top, bottom}, [&mask](int x, int y) { return mask.row(y)[x] >= 128; });
  return window;
}

}  // namespace haustra::calibration
