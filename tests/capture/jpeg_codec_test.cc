#include "capture/codec/jpeg_codec.h"

#include <gtest/gtest.h>

#include <stdlib.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <jpeglib.h>

#include "capture/codec/jpeg_memory.h"
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

// A camera's thread would wait there for mapping.
TEST(JpegCodec, DecoderAsksNothingOfTheHeap) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  for (const auto& [width, height] : {std::pair{720, 540}, {1440, 1080}, {17, 9}}) {
    for (const int quality : {80, 95}) {  // chroma at half the resolution and in full
      for (const ChannelChoice channels : {ChannelChoice::kAsStored, ChannelChoice::kGrey}) {
        std::vector<std::uint8_t> jpeg;
        ASSERT_TRUE(EncodeJpeg(Image(width, height, PixelFormat::kBgr8).view(), quality, &jpeg).ok());
        JpegDecoder decoder({width, height});
        Image image(width, height, PixelFormat::kBgr8);
        const std::uint8_t* const pixels = image.row(0);
        for (int i = 0; i < 5; ++i) {
          const AllocationTrap trap(AllocationTrap::Mode::kCount);
          const bool is_whole = decoder.Decode(jpeg, channels, &image).ok();
          const std::uint32_t num_calls = trap.count();
          EXPECT_TRUE(is_whole);
          EXPECT_EQ(num_calls, 0u) << width << "x" << height << ", picture " << i;
        }
        EXPECT_EQ(image.row(0), pixels);
      }
    }
  }
}

// With sampling factors that no encoder of ours has: {horizontal, vertical} of luma; of chroma {1, 1} unless it is
// said.
struct Sampling {
  int luma_h, luma_v;
  int chroma_h = 1, chroma_v = 1;
};

enum class Scans { kOne, kEachComponent, kProgressive };

// By libjpeg itself.
std::vector<std::uint8_t> EncodedAs(int width, int height, const Sampling& sampling, Scans scans = Scans::kOne) {
  std::mt19937 random(static_cast<unsigned>(width * 1000 + height));
  std::vector<std::uint8_t> row(static_cast<std::size_t>(width) * 3);
  jpeg_compress_struct encoder{};
  jpeg_error_mgr errors{};
  encoder.err = jpeg_std_error(&errors);
  jpeg_create_compress(&encoder);
  unsigned char* bytes = nullptr;
  unsigned long num_bytes = 0;
  jpeg_mem_dest(&encoder, &bytes, &num_bytes);
  encoder.image_width = static_cast<JDIMENSION>(width);
  encoder.image_height = static_cast<JDIMENSION>(height);
  encoder.input_components = 3;
  encoder.in_color_space = JCS_RGB;
  jpeg_set_defaults(&encoder);
  encoder.comp_info[0].h_samp_factor = sampling.luma_h;
  encoder.comp_info[0].v_samp_factor = sampling.luma_v;
  for (int i : {1, 2}) {
    encoder.comp_info[i].h_samp_factor = sampling.chroma_h;
    encoder.comp_info[i].v_samp_factor = sampling.chroma_v;
  }
  const jpeg_scan_info of_components[] = {{1, {0}, 0, 63, 0, 0}, {1, {1}, 0, 63, 0, 0}, {1, {2}, 0, 63, 0, 0}};
  if (scans == Scans::kEachComponent) {
    encoder.scan_info = of_components;
    encoder.num_scans = 3;
  }
  if (scans == Scans::kProgressive) jpeg_simple_progression(&encoder);
  jpeg_start_compress(&encoder, TRUE);
  while (encoder.next_scanline < encoder.image_height) {
    for (std::uint8_t& value : row) value = static_cast<std::uint8_t>(random());
    JSAMPROW rows = row.data();
    jpeg_write_scanlines(&encoder, &rows, 1);
  }
  jpeg_finish_compress(&encoder);
  jpeg_destroy_compress(&encoder);
  std::vector<std::uint8_t> jpeg(bytes, bytes + num_bytes);
  std::free(bytes);
  return jpeg;
}

// The picture in our memory and in the library's own, to the bit: rows that overlap, or end where its vectors go on,
// would show. The memory of a width holds all that is decoded row by row.
TEST(JpegCodec, PictureOfAnySizeAndSamplingIsTheSameInMemoryOfOurs) {
  const Sampling samplings[] = {{1, 1}, {2, 1},       {1, 2},       {2, 2},       {4, 1},       {1, 4},       {4, 2},
                                {2, 4}, {1, 2, 1, 2}, {2, 2, 1, 2}, {2, 2, 2, 1}, {1, 3, 1, 3}, {3, 1, 1, 1}, {1, 3}};
  for (const Sampling& sampling : samplings) {
    for (int width = 1; width < 150; width += width < 70 ? 1 : 13) {
      const int height = 1 + width % 37;
      const std::vector<std::uint8_t> jpeg = EncodedAs(width, height, sampling);
      JpegDecoder decoder({width, height});
      for (const ChannelChoice channels : {ChannelChoice::kAsStored, ChannelChoice::kGrey}) {
        Image image, expected;
        ASSERT_TRUE(DecodeJpeg(jpeg, channels, &expected).ok());
        const Status status = decoder.Decode(jpeg, channels, &image);
        ASSERT_TRUE(status.ok()) << status.ToString();
        for (int y = 0; y < height; ++y) {
          ASSERT_TRUE(
              std::equal(image.row(y), image.row(y) + width * BytesPerPixel(image.view().format), expected.row(y)))
              << width << "x" << height << " " << sampling.luma_h << "x" << sampling.luma_v << " row " << y;
        }
      }
    }
  }
}

// How much of it a picture takes: never more than two thirds, so that a library that wants a little more has it.
TEST(JpegCodec, MemoryOfAWidthHoldsTheMostThatAPictureTakes) {
  double largest = 0.0;
  for (const int width : {1, 64, 640, 1440, 3840}) {
    for (const Sampling& sampling : {Sampling{1, 1}, {2, 2}, {1, 4}, {2, 4}, {1, 3, 1, 3}, {4, 2}}) {
      const std::vector<std::uint8_t> jpeg = EncodedAs(width, 16, sampling);
      JpegMemory memory(width);
      jpeg_decompress_struct codec{};
      jpeg_error_mgr errors{};
      codec.err = jpeg_std_error(&errors);
      jpeg_create_decompress(&codec);
      memory.Serve(&codec);
      jpeg_mem_src(&codec, jpeg.data(), jpeg.size());
      jpeg_read_header(&codec, TRUE);
      jpeg_start_decompress(&codec);
      largest = std::max(largest, static_cast<double>(memory.num_used_bytes()) / JpegMemory::BytesFor(width));
      jpeg_destroy_decompress(&codec);
    }
  }
  EXPECT_LT(largest, 2.0 / 3.0);
  RecordProperty("largest_share_percent", static_cast<int>(100.0 * largest));
}

TEST(JpegCodec, PictureThatTheMemoryIsNotForIsRefusedAndTheNextOneRead) {
  const std::vector<std::uint8_t> fitting = EncodedAs(64, 48, {2, 2});
  JpegDecoder decoder({64, 48});
  Image image;
  const Status large = decoder.Decode(EncodedAs(65, 48, {2, 2}), ChannelChoice::kAsStored, &image);
  EXPECT_EQ(large.code(), StatusCode::kCapacityExceeded);
  EXPECT_NE(large.message().find("a picture of 65x48, larger than 64x48"), std::string::npos) << large.message();
  EXPECT_EQ(image.width(), 0) << "nothing is taken for it";
  const std::vector<std::uint8_t> progressive = EncodedAs(64, 48, {2, 2}, Scans::kProgressive);
  ASSERT_TRUE(DecodeJpeg(progressive, ChannelChoice::kAsStored, &image).ok());
  const Status many_scans = decoder.Decode(progressive, ChannelChoice::kAsStored, &image);
  EXPECT_EQ(many_scans.code(), StatusCode::kCapacityExceeded);
  EXPECT_NE(many_scans.message().find("scans"), std::string::npos) << many_scans.message();
  EXPECT_TRUE(decoder.Decode(fitting, ChannelChoice::kAsStored, &image).ok());
}

// One scan over and over takes as long as somebody likes.
TEST(JpegCodec, PictureOfScansWithoutEndIsGivenUp) {
  std::vector<std::uint8_t> jpeg = EncodedAs(64, 48, {1, 1}, Scans::kEachComponent);
  std::size_t last = 0;  // where the last scan begins
  for (std::size_t i = 0; i + 1 < jpeg.size(); ++i) {
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xda) last = i;
  }
  const std::vector<std::uint8_t> scan(jpeg.begin() + static_cast<std::ptrdiff_t>(last), jpeg.end() - kEndMarkerBytes);
  EXPECT_EQ(CodeOf(jpeg), StatusCode::kOk);
  for (int i = 0; i < 600; ++i) jpeg.insert(jpeg.end() - kEndMarkerBytes, scan.begin(), scan.end());
  Image image;
  const Status status = DecodeJpeg(jpeg, ChannelChoice::kAsStored, &image);
  EXPECT_EQ(status.code(), StatusCode::kDataLoss);
  EXPECT_NE(status.message().find("more than 500 scans"), std::string::npos) << status.message();
}

// A picture whose tables were lost would be read by those of the one before, and look like a scene.
TEST(JpegCodec, TablesOfThePictureBeforeAreForgotten) {
  const std::vector<std::uint8_t> jpeg = Encoded();
  std::vector<std::uint8_t> without;
  int num_left_out = 0;
  for (std::size_t i = 0; i < jpeg.size();) {
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xdb && num_left_out < 2) {
      i += 2 + static_cast<std::size_t>(jpeg[i + 2] * 256 + jpeg[i + 3]);
      ++num_left_out;
    } else {
      without.push_back(jpeg[i++]);
    }
  }
  ASSERT_GT(num_left_out, 0);
  JpegDecoder decoder({96, 80});
  Image image;
  ASSERT_TRUE(decoder.Decode(jpeg, ChannelChoice::kAsStored, &image).ok());
  EXPECT_EQ(decoder.Decode(without, ChannelChoice::kAsStored, &image).code(), StatusCode::kDataLoss);
}

// Motion-JPEG leaves out the usual Huffman tables.
TEST(JpegCodec, PictureWithoutHuffmanTablesHasTheUsualOnes) {
  const std::vector<std::uint8_t> jpeg = Encoded();
  std::vector<std::uint8_t> without;
  for (std::size_t i = 0; i < jpeg.size();) {
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc4) {
      i += 2 + static_cast<std::size_t>(jpeg[i + 2] * 256 + jpeg[i + 3]);
    } else {
      without.push_back(jpeg[i++]);
    }
  }
  ASSERT_LT(without.size(), jpeg.size());
  JpegDecoder decoder({96, 80});
  Image image, expected;
  ASSERT_TRUE(decoder.Decode(jpeg, ChannelChoice::kAsStored, &expected).ok());
  ASSERT_TRUE(decoder.Decode(without, ChannelChoice::kAsStored, &image).ok());
  EXPECT_TRUE(std::equal(image.row(79), image.row(79) + 3 * 96, expected.row(79)));
}

// Whatever a damaged picture does, it is answered as without the decoder's memory, and the next one is read.
TEST(JpegCodec, DamagedPicturesAreAnsweredAlikeInMemoryOfOurs) {
  std::mt19937 random(5);
  const std::vector<std::uint8_t> jpeg = Encoded("1");
  JpegDecoder decoder({96, 80});
  Image whole, image, expected;
  ASSERT_TRUE(DecodeJpeg(jpeg, ChannelChoice::kAsStored, &whole).ok());
  for (int i = 0; i < 3000; ++i) {
    std::vector<std::uint8_t> damaged = jpeg;
    for (unsigned k = 0; k <= random() % 4; ++k)
      damaged[random() % damaged.size()] = static_cast<std::uint8_t>(random());
    if (random() % 4 == 0) damaged.resize(random() % damaged.size());
    const Result<ImageSize> size = DecodeJpegSize(damaged);
    if (size.ok() && size->width_px * size->height_px > 1'000'000) continue;
    const StatusCode code = DecodeJpeg(damaged, ChannelChoice::kAsStored, &expected).code();
    const StatusCode ours = decoder.Decode(damaged, ChannelChoice::kAsStored, &image).code();
    if (ours != StatusCode::kCapacityExceeded) {
      EXPECT_EQ(ours, code) << i;
    }
    if (ours == StatusCode::kOk) {
      ASSERT_TRUE(std::equal(image.row(0), image.row(0) + 3 * image.width(), expected.row(0)));
    }
    if (i % 100 == 0) {
      ASSERT_TRUE(decoder.Decode(jpeg, ChannelChoice::kAsStored, &image).ok());
      for (int y = 0; y < 80; ++y) ASSERT_TRUE(std::equal(image.row(y), image.row(y) + 3 * 96, whole.row(y)));
    }
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
  JpegDecoder decoder({96, 80});
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
