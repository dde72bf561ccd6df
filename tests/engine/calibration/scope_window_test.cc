#include "engine/calibration/scope_window.h"

#include <gtest/gtest.h>

namespace haustra::calibration {
namespace {

struct GreyPicture {
  GreyPicture(int w, int h) : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, 8) {}
  void Fill(int left, int top, int right, int bottom, std::uint8_t grey) {
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) pixels[static_cast<std::size_t>(y) * width + x] = grey;
    }
  }
  ImageView view() const { return {pixels.data(), width, height, width, PixelFormat::kGrey8}; }
  int width, height;
  std::vector<std::uint8_t> pixels;
};

TEST(ScopeWindow, IsWhatWasBrightInAnyPicture) {
  GreyPicture left(200, 100), right(200, 100);
  left.Fill(40, 10, 99, 69, 120);
  right.Fill(100, 10, 159, 69, 120);
  ScopeWindowFinder finder(200, 100);
  finder.Add(left.view());
  finder.Add(right.view());
  const ScopeWindow window = finder.Find();
  EXPECT_NEAR(window.centre_x_px, 99.5, 1.0);
  EXPECT_NEAR(window.centre_y_px, 39.5, 1.0);
  EXPECT_NEAR(window.width_px, 120.0, 2.0);
  EXPECT_NEAR(window.height_px, 60.0, 2.0);
}

TEST(ScopeWindow, LettersBesideItDoNotCount) {
  GreyPicture picture(200, 100);
  picture.Fill(60, 0, 199, 99, 120);
  picture.Fill(4, 50, 40, 58, 255);
  ScopeWindowFinder finder(200, 100);
  finder.Add(picture.view());
  EXPECT_NEAR(finder.Find().width_px, 140.0, 2.0);
}

TEST(ScopeWindow, IsTheWholePictureWhenAllIsDark) {
  const GreyPicture picture(200, 100);
  ScopeWindowFinder finder(200, 100);
  finder.Add(picture.view());
  EXPECT_EQ(finder.Find().width_px, 200.0);
  EXPECT_EQ(finder.Find().centre_y_px, 49.5);
}

TEST(ScopeWindow, IsCutWhenItsCornersAreDark) {
  GreyPicture picture(200, 100);
  picture.Fill(0, 0, 199, 99, 120);
  const auto find = [&picture] {
    ScopeWindowFinder finder(200, 100);
    finder.Add(picture.view());
    return finder.Find();
  };
  EXPECT_FALSE(find().is_cut);
  picture.Fill(0, 0, 19, 19, 8);
  picture.Fill(180, 0, 199, 19, 8);
  EXPECT_FALSE(find().is_cut);
  picture.Fill(0, 80, 19, 99, 8);
  EXPECT_TRUE(find().is_cut);
  EXPECT_NEAR(find().width_px, 200.0, 2.0);
  picture.Fill(20, 0, 179, 99, 255);
  picture.Fill(180, 20, 199, 99, 255);
  picture.Fill(0, 20, 19, 79, 255);
  EXPECT_TRUE(ScopeWindowFinder::OfMask(picture.view(), 200, 100).is_cut);
}

TEST(ScopeWindow, FollowsAMask) {
  GreyPicture mask(200, 100);
  mask.Fill(0, 0, 199, 99, 0);
  mask.Fill(50, 20, 149, 79, 255);
  const ScopeWindow window = ScopeWindowFinder::OfMask(mask.view(), 200, 100);
  EXPECT_EQ(window.centre_x_px, 99.5);
  EXPECT_EQ(window.centre_y_px, 49.5);
  EXPECT_EQ(window.width_px, 100.0);
  EXPECT_EQ(window.height_px, 60.0);
  EXPECT_EQ(ScopeWindowFinder::OfMask({}, 200, 100).width_px, 200.0);
}

}  // namespace
}  // namespace haustra::calibration
