#include "tools/render/normal_picture.h"

#include <cmath>
#include <cstdint>

namespace haustra::render {

Image NormalPicture(const std::vector<Eigen::Vector3f>& normals, int width_px, int height_px) {
  Image picture(width_px, height_px, PixelFormat::kBgr8);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const Eigen::Vector3f& normal = normals[std::size_t(y) * width_px + x];
      for (int c = 0; c < 3; ++c) {
        const auto value = normal.isZero() ? 0L : 128L + std::lround(127.0f * normal[c]);
        picture.row(y)[3 * x + 2 - c] = static_cast<std::uint8_t>(value);
      }
    }
  }
  return picture;
}

}  // namespace haustra::render
