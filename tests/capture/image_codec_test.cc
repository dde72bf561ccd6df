#include "capture/codec/image_codec.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <turbojpeg.h>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Files made by other programs (Python's zlib and struct; ffmpeg's MJPEG encoder), as hexadecimal digits.
constexpr std::string_view kGreyPng =  // 3x2: 10 20 30 / 40 50 255
    "89504e470d0a1a0a0000000d4948445200000003000000020800000000b81f39c6000000104944415478da63e0129163d030fa0f00033701"
    "960e6e46590000000049454e44ae426082";
constexpr std::string_view kRgbPng =  // 2x1: (255 128 7) (1 2 3)
    "89504e470d0a1a0a0000000d49484452000000020000000108020000007b40e8dd0000000f4944415478da63f8dfc0cec8c40c0008a7018d"
    "9193b3ac0000000049454e44ae426082";
constexpr std::string_view kRgbaPng =  // the same with alpha 0 and 200
    "89504e470d0a1a0a0000000d4948445200000002000000010806000000f4227f8a000000114944415478da63f8dfc0cec0c8c47c02000c83"
    "0255d434954c0000000049454e44ae426082";
constexpr std::string_view kPalettePng =  // 2x1: (60 50 40) (9 8 7)
    "89504e470d0a1a0a0000000d4948445200000002000000010803000000c3fc8fb800000006504c54450908073c3228da7b7b000000000b49"
    "44415478da63606400000005000242c2449f0000000049454e44ae426082";
constexpr std::string_view kOneBitPng =  // 3x1: 255 0 255
    "89504e470d0a1a0a0000000d4948445200000003000000010100000000339b29190000000a4944415478da6358000000a200a17105cb4100"
    "00000049454e44ae426082";
constexpr std::string_view kSixteenBitPng =
    "89504e470d0a1a0a0000000d49484452000000010000000110000000006aee47160000000b4944415478da6310320100005b0047055f6c82"
    "0000000049454e44ae426082";
constexpr std::string_view kHugePng =  // states 200000x200000 pixels
    "89504e470d0a1a0a0000000d4948445200030d4000030d400800000000dc50d7d6000000084944415478da0300000000016fddc991000000"
    "0049454e44ae426082";
constexpr std::string_view kColourJpeg =  // 8x8, all of it R 200, G 100, B 50
    "ffd8ffe000104a46494600010200000100010000ffdb00430008040404040405050505050506060606060606060606060606070707080808"
    "07070706060707080808080909090808080809090a0a0a0c0c0b0b0e0e0e111114ffc4004e00010100000000000000000000000000000002"
    "0101010100000000000000000000000000060001100100000000000000000000000000000000110101000000000000000000000000000000"
    "11ffc00011080008000803011200021200031200ffda000c03010002110311003f0080551ac6bfffd9";

std::string FromHex(std::string_view digits) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes += static_cast<char>(std::stoi(std::string(digits.substr(i, 2)), nullptr, 16));
  }
  return bytes;
}

class ImageCodecTest : public ::testing::Test {
 protected:
  Result<Image> ReadHex(std::string_view digits, ChannelChoice channels = ChannelChoice::kAsStored) {
    return ReadImage(folder_.Write("image", FromHex(digits)), channels);
  }

  TempFolder folder_;
};

TEST_F(ImageCodecTest, GreyPngGivesItsPixels) {
  const Result<Image> image = ReadHex(kGreyPng);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->format(), PixelFormat::kGrey8);
  EXPECT_EQ(image->width(), 3);
  EXPECT_EQ(image->height(), 2);
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(10, 20, 30, 40, 50, 255));
}

TEST_F(ImageCodecTest, ColourPngGivesBlueFirst) {
  const Result<Image> image = ReadHex(kRgbPng);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->format(), PixelFormat::kBgr8);
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(7, 128, 255, 3, 2, 1));
}

TEST_F(ImageCodecTest, PngWithAlphaLosesIt) {
  const Result<Image> image = ReadHex(kRgbaPng);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(7, 128, 255, 3, 2, 1));
}

TEST_F(ImageCodecTest, PalettePngGivesColours) {
  const Result<Image> image = ReadHex(kPalettePng);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(40, 50, 60, 7, 8, 9));
}

TEST_F(ImageCodecTest, OneBitPngGivesBlackAndWhite) {
  const Result<Image> image = ReadHex(kOneBitPng);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(255, 0, 255));
}

TEST_F(ImageCodecTest, ColourPngAsGreyGivesLuma) {
  const Result<Image> image = ReadHex(kRgbPng, ChannelChoice::kGrey);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->format(), PixelFormat::kGrey8);
  // 0.299 R + 0.587 G + 0.114 B = 152.2 and 1.8.
  EXPECT_THAT(PixelsOf(image->view()), ElementsAre(152, 2));
}

TEST_F(ImageCodecTest, SixteenBitPngIsRefused) {
  const Result<Image> image = ReadHex(kSixteenBitPng);
  EXPECT_EQ(image.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(image.status().message(), HasSubstr("image: PNG with 16 bits a channel"));
}

TEST_F(ImageCodecTest, PngThatStatesTooManyPixelsIsRefused) {
  EXPECT_EQ(ReadHex(kHugePng).code(), StatusCode::kCapacityExceeded);
}

TEST_F(ImageCodecTest, ColourJpegGivesBlueFirst) {
  const Result<Image> image = ReadHex(kColourJpeg);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->format(), PixelFormat::kBgr8);
  EXPECT_EQ(image->width(), 8);
  EXPECT_EQ(image->height(), 8);
  for (int x = 0; x < 8; ++x) {
    EXPECT_NEAR(image->row(7)[3 * x + 0], 50, 3);
    EXPECT_NEAR(image->row(7)[3 * x + 1], 100, 3);
    EXPECT_NEAR(image->row(7)[3 * x + 2], 200, 3);
  }
}

TEST_F(ImageCodecTest, ColourJpegAsGreyGivesLuma) {
  const Result<Image> image = ReadHex(kColourJpeg, ChannelChoice::kGrey);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->format(), PixelFormat::kGrey8);
  EXPECT_NEAR(image->row(3)[4], 0.299 * 200 + 0.587 * 100 + 0.114 * 50, 2);
}

TEST_F(ImageCodecTest, CmykJpegIsRefused) {
  // TurboJPEG itself writes the file: this library has no way to.
  const std::vector<unsigned char> pixels(8 * 8 * 4, 100);
  const tjhandle codec = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  ASSERT_EQ(tjCompress2(codec, pixels.data(), 8, 32, 8, TJPF_CMYK, &bytes, &size, TJSAMP_444, 90, 0), 0);
  const std::string path = folder_.Write("cmyk.jpg", std::string_view(reinterpret_cast<char*>(bytes), size));
  tjFree(bytes);
  tjDestroy(codec);

  const Result<Image> image = ReadImage(path, ChannelChoice::kAsStored);
  EXPECT_EQ(image.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(image.status().message(), HasSubstr("cmyk.jpg: JPEG with 4 channels"));
}

TEST_F(ImageCodecTest, PngRoundTripIsLossless) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kBgr8}) {
    const Image written = RampImage(37, 21, format);
    const Result<Image> read = ReadImage(folder_.WriteImage("a.png", written), ChannelChoice::kAsStored);
    ASSERT_TRUE(read.ok()) << read.status().ToString();
    EXPECT_EQ(read->format(), format);
    EXPECT_EQ(PixelsOf(read->view()), PixelsOf(written.view()));
  }
}

TEST_F(ImageCodecTest, JpegRoundTripStaysNear) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kBgr8}) {
    const Image written = RampImage(37, 21, format);
    const Result<Image> read = ReadImage(folder_.WriteImage("a.jpg", written), ChannelChoice::kAsStored);
    ASSERT_TRUE(read.ok()) << read.status().ToString();
    ASSERT_EQ(read->format(), format);
    const std::vector<std::uint8_t> a = PixelsOf(written.view());
    const std::vector<std::uint8_t> b = PixelsOf(read->view());
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 6) << "at " << i;
  }
}

TEST_F(ImageCodecTest, HeaderGivesTheSize) {
  ImageReader reader;
  for (const std::string_view name : {"a.png", "a.jpg"}) {
    const Result<ImageSize> size = reader.ReadSize(folder_.WriteImage(name, RampImage(37, 21, PixelFormat::kBgr8)));
    ASSERT_TRUE(size.ok()) << size.status().ToString();
    EXPECT_EQ(size->width_px, 37);
    EXPECT_EQ(size->height_px, 21);
  }
}

TEST_F(ImageCodecTest, KindComesFromTheContentNotTheName) {
  const std::string path = folder_.Write("really_a_png.jpg", FromHex(kGreyPng));
  EXPECT_TRUE(ReadImage(path, ChannelChoice::kAsStored).ok());
}

TEST_F(ImageCodecTest, MissingFileIsNotFound) {
  const Result<Image> image = ReadImage(folder_.Path("no.png"), ChannelChoice::kAsStored);
  EXPECT_EQ(image.code(), StatusCode::kNotFound);
  EXPECT_THAT(image.status().message(), HasSubstr("no.png: no such file"));
}

TEST_F(ImageCodecTest, FolderInPlaceOfAFileIsDataLoss) {
  EXPECT_EQ(ReadImage(folder_.path(), ChannelChoice::kAsStored).code(), StatusCode::kDataLoss);
}

TEST_F(ImageCodecTest, EmptyFileAndTextAreDataLoss) {
  const Result<Image> empty = ReadImage(folder_.Write("empty.jpg", ""), ChannelChoice::kAsStored);
  EXPECT_EQ(empty.code(), StatusCode::kDataLoss);
  EXPECT_THAT(empty.status().message(), HasSubstr("empty.jpg: empty file"));
  const Result<Image> text = ReadImage(folder_.Write("text.jpg", "hello"), ChannelChoice::kAsStored);
  EXPECT_EQ(text.code(), StatusCode::kDataLoss);
  EXPECT_THAT(text.status().message(), HasSubstr("text.jpg: neither a PNG nor a JPEG file"));
}

TEST_F(ImageCodecTest, TruncatedFileIsDataLossAtEveryLength) {
  for (const std::string_view name : {"whole.jpg", "whole.png"}) {
    folder_.WriteImage(name, RampImage(40, 30, PixelFormat::kBgr8));
    const std::string bytes = folder_.Read(name);
    for (std::size_t size = 0; size < bytes.size(); size += 7) {
      const Result<Image> image = ReadImage(folder_.Write("cut", bytes.substr(0, size)), ChannelChoice::kAsStored);
      ASSERT_EQ(image.code(), StatusCode::kDataLoss) << name << " cut to " << size << " bytes";
      ASSERT_THAT(image.status().message(), HasSubstr("cut: "));
    }
  }
}

TEST_F(ImageCodecTest, FlippedBytesNeverCrash) {
  std::mt19937 random(7);
  for (const std::string_view name : {"whole.jpg", "whole.png"}) {
    folder_.WriteImage(name, RampImage(40, 30, PixelFormat::kBgr8));
    const std::string original = folder_.Read(name);
    int num_refused = 0;
    for (int trial = 0; trial < 200; ++trial) {
      std::string bytes = original;
      for (int flip = 0; flip < 3; ++flip) bytes[random() % bytes.size()] = static_cast<char>(random());
      const Result<Image> image = ReadImage(folder_.Write("flipped", bytes), ChannelChoice::kAsStored);
      num_refused += image.ok() ? 0 : 1;
    }
    // PNG has checksums over everything, JPEG has none.
    EXPECT_GT(num_refused, name == "whole.png" ? 175 : 25) << name;
  }
}

TEST_F(ImageCodecTest, ReaderReusesItsBufferForFramesOfOneSize) {
  const std::string first = folder_.WriteImage("a.png", RampImage(40, 30, PixelFormat::kBgr8));
  const std::string second = folder_.WriteImage("b.jpg", RampImage(40, 30, PixelFormat::kBgr8));
  ImageReader reader;
  Image image;
  ASSERT_TRUE(reader.Read(first, ChannelChoice::kAsStored, &image).ok());
  const std::uint8_t* data = image.view().data;
  ASSERT_TRUE(reader.Read(second, ChannelChoice::kAsStored, &image).ok());
  EXPECT_EQ(image.view().data, data);
}

TEST_F(ImageCodecTest, WritersRefuseWhatTheyCannotWrite) {
  const Image image = FlatImage(4, 4, PixelFormat::kGrey8, 9);
  EXPECT_EQ(WriteJpeg(folder_.Path("a.jpg"), image.view(), 0).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteJpeg(folder_.Path("a.jpg"), image.view(), 101).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteJpeg(folder_.Path("a.jpg"), {}, 90).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(WritePng(folder_.Path("a.png"), {}).code(), StatusCode::kInvalidArgument);
  const Status status = WritePng(folder_.Path("nowhere/a.png"), image.view());
  EXPECT_EQ(status.code(), StatusCode::kNotFound);
  EXPECT_THAT(status.message(), HasSubstr("nowhere/a.png: its folder does not exist"));
}

// A picture that had the name is not written over: whoever reads it meets all of it.
TEST_F(ImageCodecTest, PictureReplacesANameAndNotTheFileThatHadIt) {
  const std::string path = folder_.WriteImage("a.png", FlatImage(4, 4, PixelFormat::kGrey8, 9));
  std::filesystem::create_hard_link(path, folder_.Path("seen.png"));
  ASSERT_TRUE(WritePng(path, FlatImage(8, 8, PixelFormat::kGrey8, 7).view()).ok());
  EXPECT_EQ(ImageReader().ReadSize(path)->width_px, 8);
  EXPECT_EQ(ImageReader().ReadSize(folder_.Path("seen.png"))->width_px, 4);
}

}  // namespace
}  // namespace haustra
