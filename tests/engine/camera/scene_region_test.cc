#include "engine/camera/scene_region.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

TEST(SceneRegion, IsTheImageWithoutAMask) {
  const CameraModel camera = ColonCamera();
  const SceneRegion region(camera, {});
  EXPECT_EQ(region.share(), 1.0);
  const double right = camera.width_px() - 1, bottom = camera.height_px() - 1;
  EXPECT_TRUE(region.Shows({0.0, 0.0}));
  EXPECT_TRUE(region.Shows({right, bottom}));
  EXPECT_FALSE(region.Shows({-1.0, 5.0}));
  EXPECT_FALSE(region.Shows({right + 1.0, 5.0}));
  EXPECT_FALSE(region.Shows({5.0, bottom + 1.0}));
  EXPECT_FALSE(region.Shows({std::numeric_limits<double>::quiet_NaN(), 5.0}));
}

TEST(SceneRegion, EndsAtTheMaskToThePixel) {
  const CameraModel camera = ColonCamera();
  const int width = camera.width_px(), height = camera.height_px();
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  const auto at = [&](int x, int y) -> std::uint8_t& {
    return mask[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  };
  for (int y = 10; y < height; ++y) {
    for (int x = 20; x < width; ++x) at(x, y) = 255;
  }
  const SceneRegion region(camera, {mask.data(), width, height, width, PixelFormat::kGrey8});
  EXPECT_NEAR(region.share(), (width - 20.0) / width * (height - 10.0) / height, 1e-12);
  EXPECT_TRUE(region.Shows({20.0, 10.0}));
  EXPECT_TRUE(region.Shows({19.6, 9.6}));
  EXPECT_FALSE(region.Shows({19.4, 10.0}));
  EXPECT_FALSE(region.Shows({20.0, 9.4}));
  EXPECT_TRUE(region.Shows({width - 1.0, height - 1.0}));
}

TEST(SceneRegion, MaskThatShowsNothingIsNone) {
  const CameraModel camera = ColonCamera();
  const int width = camera.width_px(), height = camera.height_px();
  const std::vector<std::uint8_t> mask(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  const SceneRegion region(camera, {mask.data(), width, height, width, PixelFormat::kGrey8});
  EXPECT_EQ(region.share(), 1.0);
  EXPECT_TRUE(region.Shows({5.0, 5.0}));
}

// Points that fill a window of half the width and half the height fill that window, whoever says where it is.
TEST(SceneRegion, SpreadIsAShareOfTheWindow) {
  const CameraModel camera = ColonCamera();
  const int width = camera.width_px(), height = camera.height_px();
  const std::size_t num_pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<std::uint8_t> mask(num_pixels, 0), picture(num_pixels, 16);
  std::vector<Eigen::Vector2d> points;
  for (int y = height / 4; y < 3 * height / 4; ++y) {
    for (int x = width / 4; x < 3 * width / 4; ++x) {
      const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      mask[i] = 255;
      picture[i] = 100;
      if (x % 8 == 0 && y % 8 == 0) points.emplace_back(x, y);
    }
  }
  const SceneRegion masked(camera, {mask.data(), width, height, width, PixelFormat::kGrey8});
  SceneRegion seen(camera, {});
  EXPECT_NEAR(seen.Spread(points), 0.26, 0.01);
  const ImageView view{picture.data(), width, height, width, PixelFormat::kGrey8};
  seen.Observe(view, TimePoint{});
  EXPECT_NEAR(masked.Spread(points), 1.04, 0.03);
  EXPECT_NEAR(seen.Spread(points), masked.Spread(points), 0.06);
}

TEST(SceneRegion, AMaskIsBelievedBeforeThePictures) {
  const CameraModel camera = ColonCamera();
  const int width = camera.width_px(), height = camera.height_px();
  const std::size_t num_pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  std::vector<std::uint8_t> mask(num_pixels, 0), picture(num_pixels, 100);
  std::fill_n(mask.begin(), num_pixels / 2, std::uint8_t{255});
  SceneRegion region(camera, {mask.data(), width, height, width, PixelFormat::kGrey8});
  region.Observe({picture.data(), width, height, width, PixelFormat::kGrey8}, TimePoint{});
  EXPECT_NEAR(region.share(), 0.5, 1e-9);
  region.Observe({}, TimePoint{});
  EXPECT_NEAR(region.share(), 0.5, 1e-9);
}

}  // namespace
}  // namespace haustra::test
