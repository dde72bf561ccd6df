#include "capture/yuv.h"

#include <gtest/gtest.h>

#include <vector>

#include "capture/image_transform.h"

namespace haustra {
namespace {

// The same four pixels in every layout: luma 10 200 / 60 90, one colour.
constexpr std::uint8_t kCb = 100, kCr = 180;

struct Sample {
  std::vector<std::uint8_t> bytes;
  ImageView view;
};

Sample MakeSample(PixelFormat format) {
  Sample sample;
  switch (format) {
    case PixelFormat::kYuyv: sample.bytes = {10, kCb, 200, kCr, 0, 0, 60, kCb, 90, kCr, 0, 0}; break;
    case PixelFormat::kUyvy: sample.bytes = {kCb, 10, kCr, 200, 0, 0, kCb, 60, kCr, 90, 0, 0}; break;
    case PixelFormat::kNv12: sample.bytes = {10, 200, 0, 60, 90, 0, kCb, kCr, 0}; break;
    default: sample.bytes = {10, 200, 0, 60, 90, 0};
  }
  const bool is_pair = format == PixelFormat::kYuyv || format == PixelFormat::kUyvy;
  sample.view = {sample.bytes.data(), 2, 2, is_pair ? 6 : 3, format};
  return sample;
}

constexpr PixelFormat kAll[] = {PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kNv12, PixelFormat::kGrey8};

TEST(Yuv, LumaIsWhereTheFormatHasIt) {
  for (const PixelFormat format : kAll) {
    const Sample sample = MakeSample(format);
    Image grey;
    LumaToGrey(sample.view, &grey);
    ASSERT_EQ(grey.format(), PixelFormat::kGrey8);
    EXPECT_EQ(grey.row(0)[0], 10);
    EXPECT_EQ(grey.row(0)[1], 200);
    EXPECT_EQ(grey.row(1)[0], 60);
    EXPECT_EQ(grey.row(1)[1], 90);
  }
}

TEST(Yuv, HalvingIsTheRoundedMeanOfFour) {
  for (const PixelFormat format : kAll) {
    const Sample sample = MakeSample(format);
    Image half;
    HalveLuma(sample.view, &half);
    ASSERT_EQ(half.width(), 1);
    ASSERT_EQ(half.height(), 1);
    EXPECT_EQ(half.row(0)[0], 90);
    HalveColumns(sample.view, &half);
    ASSERT_EQ(half.height(), 2);
    EXPECT_EQ(half.row(0)[0], 105);
    EXPECT_EQ(half.row(1)[0], 75);
  }
}

// JFIF: R = Y + 1.402 (Cr - 128), G = Y - 0.344136 (Cb - 128) - 0.714136 (Cr - 128), B = Y + 1.772 (Cb - 128).
TEST(Yuv, ColourIsThatOfJpeg) {
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kNv12}) {
    const Sample sample = MakeSample(format);
    Image colour;
    ToBgr(sample.view, &colour);
    EXPECT_EQ(colour.row(1)[3], 40);   // 90 - 49.6
    EXPECT_EQ(colour.row(1)[4], 63);   // 90 + 9.636 - 37.135
    EXPECT_EQ(colour.row(1)[5], 163);  // 90 + 72.9
    EXPECT_EQ(colour.row(0)[5], 255);
    EXPECT_EQ(colour.row(0)[0], 0);
  }
}

TEST(Yuv, TheLumaOfTheColourIsTheLumaThatCame) {
  std::vector<std::uint8_t> bytes;
  for (int y = 60; y < 196; y += 4)
    bytes.insert(bytes.end(), {static_cast<std::uint8_t>(y), 118, static_cast<std::uint8_t>(y + 2), 140});
  const int width = static_cast<int>(bytes.size()) / 2;
  const ImageView view{bytes.data(), width, 1, static_cast<std::ptrdiff_t>(bytes.size()), PixelFormat::kYuyv};
  Image colour, grey;
  ToBgr(view, &colour);
  ToGrey(colour.view(), &grey);
  for (int x = 0; x < width; ++x) EXPECT_NEAR(grey.row(0)[x], bytes[2 * x], 1);
}

}  // namespace
}  // namespace haustra
