// What the correlation of a window asks of a picture: the window's samples, bilinear, summed with weights.
//
// Four samples at a time in compiler vectors that every target has (SSE2, NEON). Each is computed as one by one, and
// the order of the sums does not depend on the processor: same input, same bits on all.
#pragma once

#include <cstddef>
#include <vector>

#include "hal/core/views.h"

namespace haustra {

// The centre of a window and one step along its rows and its columns, pixels.
struct WindowFrame {
  float x = 0.0f, y = 0.0f;
  float along_row_x = 0.0f, along_row_y = 0.0f;
  float along_column_x = 0.0f, along_column_y = 0.0f;
};

// Over the samples of a window.
struct WindowSums {
  float values = 0.0f;    // each times its weight
  float squares = 0.0f;   // their squares times their weights
  float products = 0.0f;  // each times its pattern
};

// Samples of (2 * radius + 1)^2 places, row by row. thread-safe: constant after construction, where all memory is
// taken.
class WindowSampler {
 public:
  // `radius`: 1 and up.
  explicit WindowSampler(int radius);
  // What one takes on the heap.
  static std::size_t BytesFor(int radius);

  // Of the two arrays of Sum: the samples and, behind them, filler, whose weights and patterns are zero.
  static std::size_t PaddedSize(int radius);
  std::size_t padded_size() const { return steps_along_row_.size(); }

  // `grey`: kGrey8, at least 2x2. All corners of the window lie in [0, width - 1) x [0, height - 1), but for rounding.
  // `weights`, `patterns`: padded_size() each.
  WindowSums Sum(const ImageView& grey, const WindowFrame& frame, const float* weights, const float* patterns) const;

 private:
  std::vector<float> steps_along_row_, steps_along_column_;  // of each sample, from the centre
};

}  // namespace haustra
