#include "engine/camera/dark_surround.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace haustra::test {
namespace {

constexpr int kWidth = 640, kHeight = 360;

// Compressed black, not the same everywhere, with a window of this radius in the middle, and a lumen as dark in it.
std::vector<std::uint8_t> TowerPicture(double radius_px, int num_channels) {
  std::vector<std::uint8_t> pixels;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double from_middle = std::hypot(x - kWidth / 2.0, y - kHeight / 2.0);
      const bool is_lit = from_middle < radius_px && from_middle > 20.0;
      const auto value = static_cast<std::uint8_t>(is_lit ? 60 : 14 + (x / 3 + y / 5) % 6);
      for (int channel = 0; channel < num_channels; ++channel) pixels.push_back(value);
    }
  }
  return pixels;
}

TEST(DarkSurround, IsWhatIsDarkFromTheEdgeOnAndNotTheLumen) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kBgr8}) {
    const int num_channels = format == PixelFormat::kGrey8 ? 1 : 3;
    const std::vector<std::uint8_t> pixels = TowerPicture(150.0, num_channels);
    const DarkSurround surround({pixels.data(), kWidth, kHeight, std::ptrdiff_t{num_channels} * kWidth, format});
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double from_middle = std::hypot(x - kWidth / 2.0, y - kHeight / 2.0);
        if (from_middle > 165.0) {
          ASSERT_TRUE(surround.Holds(Eigen::Vector2d(x, y))) << x << ", " << y;
        } else if (from_middle < 140.0) {
          ASSERT_FALSE(surround.Holds(Eigen::Vector2d(x, y))) << x << ", " << y;
        }
      }
    }
  }
}

TEST(DarkSurround, ThereIsNoneInAPictureThatIsAllWindowNorOutsideOfIt) {
  const std::vector<std::uint8_t> pixels = TowerPicture(1000.0, 1);
  const DarkSurround surround({pixels.data(), kWidth, kHeight, kWidth, PixelFormat::kGrey8});
  for (const double y : {-0.4, 180.0, 359.4}) {
    for (const double x : {-0.4, 320.0, 639.4}) EXPECT_FALSE(surround.Holds({x, y})) << x << ", " << y;
  }
  const std::vector<std::uint8_t> black(kWidth * kHeight, 3);
  const DarkSurround all({black.data(), kWidth, kHeight, kWidth, PixelFormat::kGrey8});
  EXPECT_TRUE(all.Holds({0.0, 0.0}));
  EXPECT_FALSE(all.Holds({-1.0, 0.0}));
  EXPECT_FALSE(all.Holds({kWidth, 0.0}));
  EXPECT_FALSE(all.Holds({std::nan(""), 0.0}));
  EXPECT_FALSE(DarkSurround().Holds({0.0, 0.0}));
  EXPECT_FALSE(DarkSurround(ImageView{}).Holds({0.0, 0.0}));
}

}  // namespace
}  // namespace haustra::test
