// The part of the picture that the scope's window fills: what was bright at any time, or what a mask says. Its centre
// is where the optical axis is looked for, its width the measure of the focal length, its shape a sign of the scope.
// thread-bound(its owner).
#pragma once

#include <cstdint>
#include <vector>

#include "hal/core/views.h"

namespace haustra::calibration {

struct ScopeWindow {
  // Of the smallest upright rectangle around it; pixel centres at integers.
  double centre_x_px = 0.0, centre_y_px = 0.0;
  double width_px = 0.0, height_px = 0.0;
  // At least three corners of the rectangle are dark: the round or cut-corner window of an endoscope, seen whole.
  bool is_cut = false;
};

class ScopeWindowFinder {
 public:
  ScopeWindowFinder(int width_px, int height_px);
  // Any pixel format, of the size that was given.
  void Add(const ImageView& image);
  // The whole picture when nothing was bright.
  ScopeWindow Find() const;

  // Of a static mask, 255 inside; the whole picture when it is empty.
  static ScopeWindow OfMask(const ImageView& mask, int width_px, int height_px);

 private:
  int width_px_, height_px_;
  int num_columns_, num_rows_;           // every other pixel is looked at
  std::vector<std::uint8_t> brightest_;  // of all pictures
};

}  // namespace haustra::calibration
