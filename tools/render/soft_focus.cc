#include "tools/render/soft_focus.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

constexpr int kBlock = 8;  // pixels a side of the blurred copy's cells

}  // namespace

float TypicalLevel(const LinearImage& image) {
  double sum = 0.0;
  int count = 0;
  for (int y = kBlock / 2; y < image.height; y += kBlock) {
    for (int x = kBlock / 2; x < image.width; x += kBlock) {
      const float green = image.pixel(x, y)[1];
      if (green <= 0.0f) continue;
      sum += std::sqrt(green);
      ++count;
    }
  }
  const double mean = count > 0 ? sum / count : 0.1;
  return static_cast<float>(mean * mean);
}

LinearImage Blurred(const LinearImage& image) {
  LinearImage out((image.width + kBlock - 1) / kBlock, (image.height + kBlock - 1) / kBlock);
  for (int by = 0; by < out.height; ++by) {
    for (int bx = 0; bx < out.width; ++bx) {
      float sum[3] = {0.0f, 0.0f, 0.0f};
      int count = 0;
      for (int y = by * kBlock; y < std::min((by + 1) * kBlock, image.height); ++y) {
        for (int x = bx * kBlock; x < std::min((bx + 1) * kBlock, image.width); ++x, ++count) {
          for (int c = 0; c < 3; ++c) sum[c] += std::min(image.pixel(x, y)[c], 8.0f);
        }
      }
      for (int c = 0; c < 3; ++c) out.pixel(bx, by)[c] = sum[c] / static_cast<float>(count);
    }
  }
  return out;
}

void SampleBilinear(const LinearImage& image, float x, float y, float rgb[3]) {
  x = std::clamp(x, 0.0f, static_cast<float>(image.width) - 1.001f);
  y = std::clamp(y, 0.0f, static_cast<float>(image.height) - 1.001f);
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float tx = x - static_cast<float>(ix), ty = y - static_cast<float>(iy);
  const float* p00 = image.pixel(ix, iy);
  const float* p01 = image.pixel(ix, std::min(iy + 1, image.height - 1));
  const int right = ix + 1 < image.width ? 3 : 0;
  for (int c = 0; c < 3; ++c) {
    const float top = p00[c] + tx * (p00[right + c] - p00[c]);
    const float bottom = p01[c] + tx * (p01[right + c] - p01[c]);
    rgb[c] = top + ty * (bottom - top);
  }
}
void SampleBlurred(const LinearImage& blurred, float x, float y, float rgb[3]) {
  SampleBilinear(blurred, (x + 0.5f) / kBlock - 0.5f, (y + 0.5f) / kBlock - 0.5f, rgb);
}

}  // namespace haustra::render
