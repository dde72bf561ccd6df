#include "engine/camera/lit_window.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <vector>

namespace haustra::test {
namespace {

using std::chrono::milliseconds;

// A surround of grey value 16 with something in it.
class Picture {
 public:
  Picture(int width_px, int height_px)
      : width_px_(width_px), height_px_(height_px), grey_(static_cast<std::size_t>(width_px) * height_px, 16) {}

  Picture& Fill(int left, int top, int width, int height, std::uint8_t grey) {
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x) at(x, y) = grey;
    }
    return *this;
  }
  Picture& FillDisc(double centre_x, double centre_y, double radius, std::uint8_t grey) {
    for (int y = 0; y < height_px_; ++y) {
      for (int x = 0; x < width_px_; ++x) {
        if (std::hypot(x - centre_x, y - centre_y) <= radius) at(x, y) = grey;
      }
    }
    return *this;
  }
  ImageView view() const { return {grey_.data(), width_px_, height_px_, width_px_, PixelFormat::kGrey8}; }

 private:
  std::uint8_t& at(int x, int y) { return grey_[static_cast<std::size_t>(y) * width_px_ + x]; }

  int width_px_, height_px_;
  std::vector<std::uint8_t> grey_;
};

// As often as it takes to be looked at as a whole, 40 ms apart.
void Show(const Picture& picture, double from_s, LitWindow* window) {
  for (int i = 0; i < LitWindow::kTurns; ++i) {
    window->Observe(picture.view(), TimePoint{} + milliseconds(static_cast<int>(1000 * from_s) + 40 * i));
  }
}

double ShareOf(const Picture& picture) {
  LitWindow window;
  window.Observe(picture.view(), TimePoint{});
  return window.share();
}

TEST(LitWindow, IsTheShareOfARectangle) {
  // A third of a high-definition picture.
  const double share = ShareOf(Picture(1920, 1080).Fill(300, 200, 900, 800, 120));
  EXPECT_NEAR(share, 900.0 * 800.0 / (1920.0 * 1080.0), 0.02);
  EXPECT_EQ(ShareOf(Picture(640, 480).Fill(0, 0, 640, 480, 120)), 1.0);
}

TEST(LitWindow, IsTheShareOfADisc) {
  EXPECT_NEAR(ShareOf(Picture(720, 576).FillDisc(360.0, 288.0, 250.0, 90)), M_PI * 250 * 250 / (720.0 * 576.0), 0.03);
}

TEST(LitWindow, TheDarkLumenIsPartOfIt) {
  const Picture open = Picture(720, 576).FillDisc(360.0, 288.0, 250.0, 90);
  EXPECT_EQ(ShareOf(Picture(open).FillDisc(350.0, 300.0, 150.0, 5)), ShareOf(open));
}

TEST(LitWindow, LettersAndASecondPictureAreNot) {
  Picture picture = Picture(1920, 1080).Fill(300, 200, 900, 800, 120);
  const double share = ShareOf(picture);
  for (int line = 0; line < 8; ++line) picture.Fill(20, 200 + 80 * line, 250, 40, 255);
  EXPECT_EQ(ShareOf(picture), share);
  picture.Fill(1400, 300, 400, 300, 200);
  EXPECT_EQ(ShareOf(picture), share);
}

TEST(LitWindow, GrowsByWhatIsLitLater) {
  LitWindow window;
  window.Observe(Picture(640, 480).Fill(0, 0, 320, 480, 100).view(), TimePoint{});
  EXPECT_NEAR(window.share(), 0.5, 0.02);
  Show(Picture(640, 480).Fill(320, 0, 320, 480, 100), 1.0, &window);
  EXPECT_EQ(window.share(), 1.0);
}

// A card that fills the picture before the scope is plugged in. At any frame rate.
TEST(LitWindow, ForgetsWhatIsNoLongerLit) {
  const Picture card = Picture(640, 480).Fill(0, 0, 640, 480, 200),
                scope = Picture(640, 480).Fill(160, 0, 320, 480, 90);
  for (const int period_ms : {17, 40, 300, 1000, 3000}) {
    LitWindow window;
    window.Observe(card.view(), TimePoint{});
    int at_ms = period_ms;
    for (; at_ms < 2000; at_ms += period_ms) window.Observe(scope.view(), TimePoint{} + milliseconds(at_ms));
    EXPECT_EQ(window.share(), 1.0) << period_ms;
    for (int i = 0; i < 2 * LitWindow::kTurns || at_ms < 4500; ++i, at_ms += period_ms) {
      window.Observe(scope.view(), TimePoint{} + milliseconds(at_ms));
    }
    EXPECT_NEAR(window.share(), 0.5, 0.02) << period_ms;
  }
}

TEST(LitWindow, StaysWhenTheLightGoesOut) {
  LitWindow window;
  EXPECT_EQ(window.share(), 1.0);
  Show(Picture(640, 480), 0.0, &window);
  EXPECT_EQ(window.share(), 1.0);
  Show(Picture(640, 480).Fill(160, 0, 320, 480, 90), 1.0, &window);
  const double share = window.share();
  EXPECT_NEAR(share, 0.5, 0.02);
  for (int second = 2; second <= 60; ++second) Show(Picture(640, 480), second, &window);
  EXPECT_EQ(window.share(), share);
}

TEST(LitWindow, AGlimpseOfLightIsNotTheWindow) {
  EXPECT_EQ(ShareOf(Picture(640, 480).FillDisc(320.0, 240.0, 40.0, 200)), LitWindow::kMinShare);
}

TEST(LitWindow, AClockThatIsSetBackForgetsNothing) {
  LitWindow window;
  Show(Picture(640, 480).Fill(0, 0, 320, 480, 100), 100.0, &window);
  Show(Picture(640, 480).Fill(320, 0, 320, 480, 100), 1.0, &window);
  EXPECT_EQ(window.share(), 1.0);
}

TEST(LitWindow, ReadsEveryPixelFormat) {
  constexpr int kWidth = 128, kHeight = 128;
  // Red tissue on the left half.
  std::vector<std::uint8_t> bgr(3 * kWidth * kHeight, 0), yuyv(2 * kWidth * kHeight, 128),
      uyvy(2 * kWidth * kHeight, 128);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto i = static_cast<std::size_t>(y) * kWidth + x;
      const std::uint8_t luma = x < kWidth / 2 ? 80 : 16;
      if (x < kWidth / 2) bgr[3 * i + 2] = 200;
      yuyv[2 * i] = luma;
      uyvy[2 * i + 1] = luma;
    }
  }
  for (const ImageView& image : {ImageView{bgr.data(), kWidth, kHeight, 3 * kWidth, PixelFormat::kBgr8},
                                 ImageView{yuyv.data(), kWidth, kHeight, 2 * kWidth, PixelFormat::kYuyv},
                                 ImageView{uyvy.data(), kWidth, kHeight, 2 * kWidth, PixelFormat::kUyvy}}) {
    LitWindow window;
    window.Observe(image, TimePoint{});
    EXPECT_NEAR(window.share(), 0.5, 0.01);
  }
}

}  // namespace
}  // namespace haustra::test
