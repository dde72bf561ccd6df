// A scene of Gaussian blobs on a plane, known in closed form: it can be seen through any similarity without resampling,
// so where each point of one picture lies in another is exact.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "hal/core/views.h"

namespace haustra::testing {

struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;

  ImageView view() const { return {pixels.data(), width, height, width, PixelFormat::kGrey8}; }
  std::uint8_t& at(int x, int y) { return pixels[static_cast<std::size_t>(y) * width + x]; }
};

struct Blob {
  double x_px = 0.0;
  double y_px = 0.0;
  double sigma_px = 1.0;
  double height = 0.0;  // grey values; negative: dark
};

// picture point = scale * R(angle) * (scene point - scene_centre) + picture_centre
struct ViewOfScene {
  double scale = 1.0;
  double angle_rad = 0.0;
  double scene_x = 0.0, scene_y = 0.0;
  double picture_x = 0.0, picture_y = 0.0;

  void Map(double x, double y, double* u, double* v) const {
    const double c = scale * std::cos(angle_rad);
    const double s = scale * std::sin(angle_rad);
    *u = c * (x - scene_x) - s * (y - scene_y) + picture_x;
    *v = s * (x - scene_x) + c * (y - scene_y) + picture_y;
  }
};

inline Picture Render(const std::vector<Blob>& blobs, int width, int height, double background,
                      const ViewOfScene& view = {}) {
  std::vector<double> sum(static_cast<std::size_t>(width) * height, background);
  for (const Blob& blob : blobs) {
    double u = 0.0;
    double v = 0.0;
    view.Map(blob.x_px, blob.y_px, &u, &v);
    const double sigma = blob.sigma_px * view.scale;
    const int reach = static_cast<int>(std::ceil(4.5 * sigma));
    const int first_x = std::max(0, static_cast<int>(u) - reach);
    const int last_x = std::min(width - 1, static_cast<int>(u) + reach);
    const int first_y = std::max(0, static_cast<int>(v) - reach);
    const int last_y = std::min(height - 1, static_cast<int>(v) + reach);
    for (int y = first_y; y <= last_y; ++y) {
      for (int x = first_x; x <= last_x; ++x) {
        const double squares = (x - u) * (x - u) + (y - v) * (y - v);
        sum[static_cast<std::size_t>(y) * width + x] += blob.height * std::exp(-squares / (2 * sigma * sigma));
      }
    }
  }
  Picture picture{width, height, {}};
  for (const double value : sum) {
    picture.pixels.push_back(static_cast<std::uint8_t>(std::lround(std::fmin(std::fmax(value, 0.0), 255.0))));
  }
  return picture;
}

// Blobs of many sizes all over [-margin, width + margin) x [-margin, height + margin).
inline std::vector<Blob> RandomBlobs(int count, int width, int height, double margin, double max_height,
                                     unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Blob> blobs;
  for (int i = 0; i < count; ++i) {
    Blob blob;
    blob.x_px = -margin + unit(random) * (width + 2 * margin);
    blob.y_px = -margin + unit(random) * (height + 2 * margin);
    blob.sigma_px = 1.3 * std::exp2(3.0 * unit(random) * unit(random));
    blob.height = (unit(random) < 0.5 ? -1.0 : 1.0) * max_height * (0.3 + 0.7 * unit(random));
    blobs.push_back(blob);
  }
  return blobs;
}

}  // namespace haustra::testing
