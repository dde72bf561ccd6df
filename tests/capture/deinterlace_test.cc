#include "capture/deinterlace.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "capture/image_transform.h"
#include "capture/yuv.h"
#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;

constexpr double kLittleMotionPx = 1.5;
constexpr PixelFormat kAllFormats[] = {PixelFormat::kGrey8, PixelFormat::kBgr8, PixelFormat::kNv12, PixelFormat::kYuyv,
                                       PixelFormat::kUyvy};

// Texture at a place of the scene, 40 to 200, alike over about eight pixels in both directions.
int SceneAt(double x, double y) {
  return static_cast<int>(std::lround(120 + 45 * std::sin(0.71 * x + 0.2 * y) + 35 * std::sin(0.6 * y - 0.33 * x)));
}

// The scene; odd rows see it `shift_px` further to the right.
Image Picture(int width, int height, PixelFormat format, double shift_px) {
  Image image(width, height, format);
  for (int y = 0; y < MemoryRows(format, height); ++y) {
    for (int i = 0; i < width * BytesPerPixel(format); ++i) {
      const double x = i / BytesPerPixel(format);
      image.row(y)[i] = static_cast<std::uint8_t>(SceneAt(y % 2 == 1 ? x + shift_px : x, y));
    }
  }
  return image;
}

// Alike over some fifty pixels, as most of a wall is.
Image Smooth(int width, int height, PixelFormat format) {
  Image image(width, height, format);
  const int bytes = BytesPerPixel(format);
  for (int y = 0; y < MemoryRows(format, height); ++y) {
    for (int i = 0; i < width * bytes; ++i) {
      image.row(y)[i] = static_cast<std::uint8_t>(SceneAt(0.15 * (i / bytes), 0.15 * y));
    }
  }
  return image;
}

Image Progressive() { return Picture(96, 72, PixelFormat::kBgr8, 0.0); }
Image Woven() { return Picture(96, 72, PixelFormat::kBgr8, 5.0); }

Image Noise(int width, int height, double mean, double sigma, std::uint32_t seed) {
  std::mt19937 bits(seed);
  std::normal_distribution<double> normal(mean, sigma);
  Image image(width, height, PixelFormat::kGrey8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.row(y)[x] = static_cast<std::uint8_t>(std::clamp(normal(bits), 0.0, 255.0));
  }
  return image;
}

// Fewer levels, `step` apart, by an ordered dither of 4x4 thresholds: the mean of a neighbourhood stays.
Image Dithered(const Image& image, int step) {
  constexpr int kThresholds[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
  Image dithered(image.width(), image.height(), image.format());
  const int bytes = BytesPerPixel(image.format());
  for (int y = 0; y < MemoryRows(image.format(), image.height()); ++y) {
    for (int i = 0; i < image.width() * bytes; ++i) {
      const int raised = image.row(y)[i] + kThresholds[y % 4][i / bytes % 4] * step / 16;
      dithered.row(y)[i] = static_cast<std::uint8_t>(raised / step * step);
    }
  }
  return dithered;
}

Image Column(std::initializer_list<int> values) {
  Image image(1, static_cast<int>(values.size()), PixelFormat::kGrey8);
  int y = 0;
  for (const int value : values) image.row(y++)[0] = static_cast<std::uint8_t>(value);
  return image;
}

TEST(Combing, TellsWovenPicturesFromProgressiveOnesInAllFormats) {
  for (const PixelFormat format : kAllFormats) {
    const Image progressive = Picture(96, 72, format, 0.0), woven = Picture(96, 72, format, 5.0);
    EXPECT_LT(Combing(progressive.view()), 0.8) << static_cast<int>(format);
    EXPECT_GT(Combing(woven.view()), 1.5) << static_cast<int>(format);
    EXPECT_FALSE(IsCombed(progressive.view()));
    EXPECT_TRUE(IsCombed(woven.view()));
  }
}

TEST(Combing, GrowsWithTheMotionBetweenTheFields) {
  double before = 0.0;
  for (const double shift_px : {0.0, 1.0, 2.0, 4.0}) {
    const double combing = Combing(Picture(240, 180, PixelFormat::kGrey8, shift_px).view());
    EXPECT_GT(combing, before) << shift_px;
    before = combing;
  }
}

// Three rows of nine stand for all of them.
TEST(Combing, OfTheRowsThatAreLookedAtIsThatOfAllRows) {
  for (const double shift_px : {0.0, 2.0, 5.0}) {
    const Image image = Picture(240, 180, PixelFormat::kGrey8, shift_px);
    double neighbours = 0.0, every_other = 0.0;
    for (int y = 0; y + 2 < 180; ++y) {
      for (int x = 0; x < 240; ++x) {
        neighbours += std::abs(image.row(y + 1)[x] - image.row(y)[x]);
        every_other += std::abs(image.row(y + 2)[x] - image.row(y)[x]);
      }
    }
    EXPECT_NEAR(Combing(image.view()) / (neighbours / every_other), 1.0, 0.1) << shift_px;
  }
}

TEST(Combing, OfWhiteNoiseIsOneAndThatIsNotCombed) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const Image noise = Noise(240, 180, 128, 40, seed);
    EXPECT_NEAR(Combing(noise.view()), 1.0, 0.05);
    EXPECT_FALSE(IsCombed(noise.view())) << seed;
  }
}

// Processors sharpen: neighbours then differ by more than chance. In the dark that is all that is to be seen.
TEST(Combing, SharpenedNoiseOfADarkPictureIsNotCombed) {
  const Image noise = Noise(240, 180, 20, 0.8, 1);
  Image sharpened(240, 180, PixelFormat::kGrey8);
  CopyImage(noise.view(), &sharpened);
  for (int y = 1; y < 179; ++y) {
    for (int x = 0; x < 240; ++x) {
      const int value = (6 * noise.row(y)[x] - noise.row(y - 1)[x] - noise.row(y + 1)[x] + 2) / 4;
      sharpened.row(y)[x] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
    }
  }
  EXPECT_GT(Combing(sharpened.view()), 1.0);
  EXPECT_FALSE(IsCombed(sharpened.view()));
}

// A palette of few colours alternates between them from pixel to pixel, across as much as down.
TEST(Combing, ADitheredPictureIsNotCombed) {
  for (const PixelFormat format : kAllFormats) {
    for (const int step : {32, 48, 64}) {
      const Image dithered = Dithered(Smooth(240, 180, format), step);
      EXPECT_GT(Combing(dithered.view()), kCombedFrom) << step;
      EXPECT_FALSE(IsCombed(dithered.view())) << step << " " << static_cast<int>(format);
    }
  }
}

TEST(Combing, AWovenPictureThatWasDitheredIsCombed) {
  for (const PixelFormat format : kAllFormats) {
    EXPECT_TRUE(IsCombed(Dithered(Picture(240, 180, format, 5.0), 16).view())) << static_cast<int>(format);
  }
}

// Columns of white noise differ by chance, too.
TEST(Combing, AWovenPictureWithMuchNoiseIsCombed) {
  Image woven = Picture(240, 180, PixelFormat::kGrey8, 5.0);
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const Image noise = Noise(240, 180, 128, 20, seed);
    Image noisy;
    CopyImage(woven.view(), &noisy);
    for (int y = 0; y < 180; ++y) {
      for (int x = 0; x < 240; ++x) {
        noisy.row(y)[x] = static_cast<std::uint8_t>(std::clamp(woven.row(y)[x] + noise.row(y)[x] - 128, 0, 255));
      }
    }
    EXPECT_TRUE(IsCombed(noisy.view())) << seed;
  }
}

TEST(Combing, FlatSmallAndEmptyPicturesAreNotCombed) {
  for (const Image& image : {FlatImage(64, 48, PixelFormat::kBgr8, 90), FlatImage(64, 48, PixelFormat::kGrey8, 0),
                             Column({0, 255}), Column({7}), Image()}) {
    EXPECT_EQ(Combing(image.view()), 0.0);
    EXPECT_FALSE(IsCombed(image.view()));
  }
}

TEST(Combing, RowsThatAreAlikeTwoByTwoAreCombedAsMuchAsCanBe) {
  Image stripes(64, 48, PixelFormat::kGrey8);
  for (int y = 0; y < 48; ++y) std::fill_n(stripes.row(y), 64, y % 2 == 0 ? 40 : 200);
  EXPECT_GT(Combing(stripes.view()), 100.0);
  EXPECT_TRUE(IsCombed(stripes.view()));
}

TEST(KeepTopField, OddRowsAreTheMeanOfTheirNeighboursRoundedUpAtAHalf) {
  Image odd_height = Column({10, 99, 21, 99, 20});
  KeepTopField(&odd_height);
  EXPECT_THAT(PixelsOf(odd_height.view()), ElementsAre(10, 16, 21, 21, 20));
  // The last row has none below.
  Image even_height = Column({255, 0, 254, 0});
  KeepTopField(&even_height);
  EXPECT_THAT(PixelsOf(even_height.view()), ElementsAre(255, 255, 254, 254));
}

TEST(KeepTopField, PicturesOfOneAndTwoRowsAndNone) {
  Image one = Column({7}), two = Column({7, 200}), none;
  KeepTopField(&one);
  KeepTopField(&two);
  KeepTopField(&none);
  EXPECT_THAT(PixelsOf(one.view()), ElementsAre(7));
  EXPECT_THAT(PixelsOf(two.view()), ElementsAre(7, 7));
}

TEST(KeepTopField, WorksOnEachByteOfAPixelInAllFormats) {
  for (const PixelFormat format : kAllFormats) {
    const Image woven = Picture(16, 12, format, 5.0);
    Image kept;
    KeepTopField(woven.view(), &kept);
    ASSERT_EQ(kept.format(), format);
    ASSERT_EQ(kept.width(), 16);
    ASSERT_EQ(kept.height(), 12);
    Image in_place;
    CopyImage(woven.view(), &in_place);
    KeepTopField(&in_place);
    // Planes of 12 rows and, of kNv12, 6 more.
    for (const auto& [first, end] : {std::pair{0, 12}, {12, MemoryRows(format, 12)}}) {
      for (int y = first; y < end; ++y) {
        for (int i = 0; i < 16 * BytesPerPixel(format); ++i) {
          const int above = woven.row(y - 1 + (y == 0))[i], below = y + 1 < end ? woven.row(y + 1)[i] : above;
          const int expected = (y - first) % 2 == 0 ? woven.row(y)[i] : (above + below + 1) / 2;
          ASSERT_EQ(kept.row(y)[i], expected) << y << " " << i << " " << static_cast<int>(format);
          ASSERT_EQ(in_place.row(y)[i], expected);
        }
      }
    }
  }
}

TEST(KeepTopField, APictureInAnotherPitchIsLeftAsItIs) {
  const Image woven = Picture(40, 20, PixelFormat::kGrey8, 5.0);
  ImageView part = woven.view();
  part.data += 2 * part.pitch_bytes + 8;
  part.width = 16;
  part.height = 9;
  const std::vector<std::uint8_t> before = PixelsOf(woven.view());
  Image kept;
  KeepTopField(part, &kept);
  EXPECT_EQ(kept.row(2)[3], woven.row(4)[11]);
  EXPECT_EQ(kept.row(3)[3], (woven.row(4)[11] + woven.row(6)[11] + 1) / 2);
  EXPECT_THAT(PixelsOf(woven.view()), ElementsAreArray(before));
}

TEST(KeepTopField, WhatIsKeptIsNotCombedAndHalvesWhereTheCalibrationSays) {
  // A ramp of 4 a row: half a picture has the mean of rows 2 y and 2 y + 1.
  Image ramp(4, 32, PixelFormat::kGrey8);
  for (int y = 0; y < 32; ++y) std::fill_n(ramp.row(y), 4, y % 2 == 0 ? 4 * y : 0);
  KeepTopField(&ramp);
  Image half;
  HalveImage(ramp.view(), &half);
  for (int y = 0; y < 15; ++y) EXPECT_EQ(half.row(y)[1], 8 * y + 2);
  Image woven = Woven();
  KeepTopField(&woven);
  EXPECT_LT(Combing(woven.view()), 0.8);
}

TEST(Deinterlacer, AutoShowsCombedPicturesByOneFieldAndAfterThreeAllOfThem) {
  const Image progressive = Progressive(), woven = Picture(96, 72, PixelFormat::kBgr8, kLittleMotionPx);
  ASSERT_TRUE(IsCombed(woven.view()));
  ASSERT_LT(Combing(woven.view()), Deinterlacer::kClearlyCombedFrom);
  Deinterlacer deinterlacer(DeinterlaceChoice::kAuto);
  EXPECT_FALSE(deinterlacer.WantsTopField(progressive.view()));
  EXPECT_TRUE(deinterlacer.WantsTopField(woven.view()));
  EXPECT_FALSE(deinterlacer.WantsTopField(progressive.view()));
  EXPECT_TRUE(deinterlacer.WantsTopField(woven.view()));
  EXPECT_FALSE(deinterlacer.WantsTopField(progressive.view()));
  EXPECT_TRUE(deinterlacer.WantsTopField(woven.view()));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(deinterlacer.WantsTopField(progressive.view()));
  deinterlacer.Restart();
  EXPECT_FALSE(deinterlacer.WantsTopField(progressive.view()));
}

TEST(Deinterlacer, OneClearlyCombedPictureIsEnough) {
  const Image progressive = Progressive(), woven = Woven();
  Deinterlacer deinterlacer(DeinterlaceChoice::kAuto);
  EXPECT_TRUE(deinterlacer.WantsTopField(woven.view()));
  EXPECT_TRUE(deinterlacer.WantsTopField(progressive.view()));
}

TEST(Deinterlacer, DitheredPicturesStayWhole) {
  const Image dithered = Dithered(Smooth(240, 180, PixelFormat::kBgr8), 64);
  Deinterlacer deinterlacer(DeinterlaceChoice::kAuto);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(deinterlacer.WantsTopField(dithered.view()));
}

TEST(Deinterlacer, OffAndOnDoNotLook) {
  const Image progressive = Progressive(), woven = Woven();
  Deinterlacer off(DeinterlaceChoice::kOff), on(DeinterlaceChoice::kOn);
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(off.WantsTopField(woven.view()));
    EXPECT_TRUE(on.WantsTopField(progressive.view()));
  }
}

TEST(DeinterlaceChoice, IsReadFromItsWordAndNothingElse) {
  EXPECT_EQ(ParseDeinterlaceChoice("auto").value(), DeinterlaceChoice::kAuto);
  EXPECT_EQ(ParseDeinterlaceChoice("off").value(), DeinterlaceChoice::kOff);
  EXPECT_EQ(ParseDeinterlaceChoice("on").value(), DeinterlaceChoice::kOn);
  for (const char* text : {"", "ON", "auto ", "bob"}) {
    EXPECT_EQ(ParseDeinterlaceChoice(text).code(), StatusCode::kInvalidArgument) << text;
  }
  EXPECT_THAT(ParseDeinterlaceChoice("bob").status().message(), HasSubstr("'bob' is none of auto, off, on"));
}

}  // namespace
}  // namespace haustra
