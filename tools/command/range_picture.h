// True range of a rendered frame as a 16-bit PGM file, which OpenCV, ImageMagick and GIMP open as it is: P5, most
// significant byte first. A value is the distance along the ray in 1/256 mm, 0: not known. Cell (0, 0) covers the first
// kStepPx x kStepPx pixels, its ray is that of their common centre (CellCentrePx). reentrant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

struct RangePicture {
  static constexpr int kStepPx = 4;
  static constexpr double kUnitMm = 1.0 / 256.0;

  int width = 0;
  int height = 0;
  std::vector<float> range_mm;  // width * height, row by row; 0: not known
};

// Ranges that have no value of 16 bits are written as not known.
std::string RangePictureBytes(const RangePicture& picture);

// kNotFound, kUnavailable: the file; kInvalidArgument: not a 16-bit PGM of the stated size. Messages begin with path.
Result<RangePicture> ReadRangePicture(const std::string& path);

}  // namespace haustra
