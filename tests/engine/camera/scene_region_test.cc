#include "engine/camera/scene_region.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace haustra::test
