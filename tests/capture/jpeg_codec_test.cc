#include "capture/codec/jpeg_codec.h"

#include <gtest/gtest.h>

#include <stdlib.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "platform/trap/allocation_trap.h"

namespace haustra::capture::internal {
namespace {

constexpr int kEndMarkerBytes = 2;

// A picture with detail; `restart`: rows of blocks between two restart markers, as some cameras set them; null: none.
std::vector<std::uint8_t> Encoded(const char* restart = nullptr) {
  Image image(96, 80, PixelFormat::kBgr8);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 3 * 96; ++x) image.row(y)[x] = static_cast<std::uint8_t>(x * 7 + y * y * 3);
  }
  std::vector<std::uint8_t> bytes;
  if (restart != nullptr) ::setenv("TJ_RESTART", restart, 1);
  EXPECT_TRUE(EncodeJpeg(image.view(), 80, &bytes).ok());
  ::unsetenv("TJ_RESTART");
  return bytes;
}

std::vector<std::uint8_t> WithBytesBeforeTheEnd(std::vector<std::uint8_t> jpeg, std::size_t count) {
  jpeg.insert(jpeg.end() - kEndMarkerBytes, count, 0);
  return jpeg;
}

StatusCode CodeOf(const std::vector<std::uint8_t>& jpeg) {
  Image image;
  return DecodeJpeg(jpeg, ChannelChoice::kAsStored, &image).code();
}

// Cameras fill up to the end of a transfer.
TEST(JpegCodec, PictureWithBytesAfterItsLastBlockIsWhole) {
  for (const char* restart : {static_cast<const char*>(nullptr), "1"}) {
    const std::vector<std::uint8_t> jpeg = Encoded(restart);
    const std::vector<std::uint8_t> padded = WithBytesBeforeTheEnd(jpeg, 5);
    Image whole, image;
    ASSERT_TRUE(DecodeJpeg(jpeg, ChannelChoice::kAsStored, &whole).ok());
    const Status status = DecodeJpeg(padded, ChannelChoice::kAsStored, &image);
    ASSERT_TRUE(status.ok()) << status.ToString();
    for (int y = 0; y < image.height(); ++y) {
      ASSERT_TRUE(std::equal(image.row(y), image.row(y) + 3 * image.width(), whole.row(y))) << y;
    }
  }
  std::vector<std::uint8_t> followed = Encoded();
  followed.resize(followed.size() + 100);
  EXPECT_EQ(CodeOf(followed), StatusCode::kOk);
}

// What a camera's thread asks of the heap, which mapping uses, too. The library takes its memory anew for each picture;
// a picture of twice the size takes no more blocks. The handle and the picture are ours and stay.
TEST(JpegCodec, DecoderAsksTheHeapForAFewBlocksAPicture) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  constexpr std::uint32_t kMostCalls = 32;  // each block is taken and given back
  for (const auto& [width, height] : {std::pair{720, 540}, {1440, 1080}}) {
    std::vector<std::uint8_t> jpeg;
    ASSERT_TRUE(EncodeJpeg(Image(width, height, PixelFormat::kBgr8).view(), 80, &jpeg).ok());
    JpegDecoder decoder;
    Image image(width, height, PixelFormat::kBgr8);
    const std::uint8_t* const pixels = image.row(0);
    for (int i = 0; i < 5; ++i) {
      const AllocationTrap trap(AllocationTrap::Mode::kCount);
      const bool is_whole = decoder.Decode(jpeg, ChannelChoice::kAsStored, &image).ok();
      const std::uint32_t num_calls = trap.count();
      EXPECT_TRUE(is_whole);
      EXPECT_LE(num_calls, kMostCalls);
    }
    EXPECT_EQ(image.row(0), pixels);
  }
}

TEST(JpegCodec, PictureCutAnywhereIsDamagedWhateverFollowsTheCut) {
  for (const char* restart : {static_cast<const char*>(nullptr), "1"}) {
    const std::vector<std::uint8_t> jpeg = Encoded(restart);
    for (std::size_t size = jpeg.size() / 2; size + 8 < jpeg.size(); ++size) {
      std::vector<std::uint8_t> cut(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_EQ(CodeOf(cut), StatusCode::kDataLoss) << size;
      cut.insert(cut.end(), {0xff, 0xd9});
      EXPECT_EQ(CodeOf(cut), StatusCode::kDataLoss) << size;
    }
  }
}

TEST(JpegCodec, PictureThatEndsWhereItWouldRestartIsDamaged) {
  const std::vector<std::uint8_t> jpeg = Encoded("1");
  int num_cuts = 0;
  for (std::size_t i = jpeg.size() / 2; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] != 0xff || jpeg[i + 1] < 0xd0 || jpeg[i + 1] > 0xd7) continue;
    std::vector<std::uint8_t> cut(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(i));
    cut.insert(cut.end(), {0xff, 0xd9});
    EXPECT_EQ(CodeOf(WithBytesBeforeTheEnd(cut, 5)), StatusCode::kDataLoss) << i;
    ++num_cuts;
  }
  EXPECT_GT(num_cuts, 1);
}

TEST(JpegCodec, RestartMarkersOutOfOrderAreDamage) {
  std::vector<std::uint8_t> jpeg = Encoded("1");
  int num_changed = 0;
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] != 0xff || jpeg[i + 1] != 0xd1) continue;
    jpeg[i + 1] = 0xd3;
    ++num_changed;
  }
  ASSERT_EQ(num_changed, 1);
  EXPECT_EQ(CodeOf(jpeg), StatusCode::kDataLoss);
  EXPECT_EQ(CodeOf(WithBytesBeforeTheEnd(jpeg, 5)), StatusCode::kDataLoss);
}

TEST(JpegCodec, DecoderIsUsedAgainAfterDamage) {
  JpegDecoder decoder;
  Image image;
  const std::vector<std::uint8_t> jpeg = Encoded();
  const std::vector<std::uint8_t> cut(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size() / 2));
  ASSERT_TRUE(decoder.Decode(jpeg, ChannelChoice::kGrey, &image).ok());
  const std::uint8_t* pixels = image.row(0);
  EXPECT_EQ(decoder.Decode(cut, ChannelChoice::kGrey, &image).code(), StatusCode::kDataLoss);
  EXPECT_TRUE(decoder.Decode(jpeg, ChannelChoice::kGrey, &image).ok());
  EXPECT_EQ(image.row(0), pixels) << "into the same memory";
}

}  // namespace
}  // namespace haustra::capture::internal
