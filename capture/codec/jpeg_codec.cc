#include "capture/codec/jpeg_codec.h"

#include <memory>
#include <string>
#include <string_view>

#include <turbojpeg.h>

namespace haustra::capture::internal {
namespace {

// Part of the answer, bit for bit: the same exact integer transform in every build.
constexpr int kTransform = TJFLAG_ACCURATEDCT;

struct Closer {
  void operator()(void* codec) const { tjDestroy(codec); }
};
using Codec = std::unique_ptr<void, Closer>;

struct Header {
  ImageSize size;
  bool is_grey = false;
  int subsampling = 0;  // TJSAMP
};

Status Damaged(void* codec) { return DataLoss(std::string("damaged JPEG file: ") + tjGetErrorStr2(codec)); }

Result<Header> ReadHeader(void* codec, std::span<const std::uint8_t> bytes) {
  if (codec == nullptr) return Internal("TurboJPEG cannot start");
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(codec, bytes.data(), bytes.size(), &width, &height, &subsampling, &colours) != 0) {
    return Damaged(codec);
  }
  // A file of tables and nothing else has a good header.
  if (width <= 0 || height <= 0) return DataLoss("damaged JPEG file: no picture in it");
  if (std::int64_t{width} * height > kMaxImagePixels) {
    return CapacityExceeded(std::to_string(width) + "x" + std::to_string(height) + " pixels are more than " +
                            std::to_string(kMaxImagePixels));
  }
  if (colours != TJCS_GRAY && colours != TJCS_YCbCr && colours != TJCS_RGB) {
    return InvalidArgument("JPEG with 4 channels; grey, YCbCr and RGB are supported");
  }
  return Header{{width, height}, colours == TJCS_GRAY, subsampling};
}

constexpr std::uint8_t kMark = 0xff, kFirstRestart = 0xd0, kEnd = 0xd9, kScan = 0xda, kRestartInterval = 0xdd;
constexpr int kNumRestarts = 8;  // they count from 0 to 7 and begin anew

// Whether every restart marker that the header announces is there and in its turn. One scan only.
bool HasAllRestarts(std::span<const std::uint8_t> bytes, const Header& header) {
  const auto number_at = [&](std::size_t at) { return bytes[at] * 256 + bytes[at + 1]; };
  int interval = 0;
  std::size_t at = 2;
  std::uint8_t marker = 0;
  while (marker != kScan) {
    if (at + 6 > bytes.size() || bytes[at] != kMark) return false;
    marker = bytes[at + 1];
    if (marker == kMark) {  // filled up
      ++at;
      continue;
    }
    if (marker == kRestartInterval) interval = number_at(at + 4);
    at += 2 + static_cast<std::size_t>(number_at(at + 2));
  }
  if (interval == 0) return true;
  int num_restarts = 0;
  for (; at + 1 < bytes.size() && !(bytes[at] == kMark && bytes[at + 1] == kEnd); ++at) {
    if (bytes[at] != kMark || bytes[at + 1] == 0 || bytes[at + 1] == kMark) continue;
    if (bytes[at + 1] != kFirstRestart + num_restarts++ % kNumRestarts) return false;
  }
  const int block_width = tjMCUWidth[header.subsampling], block_height = tjMCUHeight[header.subsampling];
  const int num_blocks = ((header.size.width_px + block_width - 1) / block_width) *
                         ((header.size.height_px + block_height - 1) / block_height);
  return num_restarts == (num_blocks - 1) / interval;
}

// The library keeps the first of its warnings. When that is of bytes before the end marker, all blocks were read before
// it, and nothing comes after it; but where a restart marker was due, the end is early.
bool IsOnlyFilledUp(void* codec, std::span<const std::uint8_t> bytes, const Header& header) {
  return tjGetErrorCode(codec) == TJERR_WARNING &&
         std::string_view(tjGetErrorStr2(codec)).ends_with("extraneous bytes before marker 0xd9") &&
         HasAllRestarts(bytes, header);
}

}  // namespace

bool IsJpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

JpegDecoder::JpegDecoder() : codec_(tjInitDecompress()) {}

JpegDecoder::~JpegDecoder() {
  if (codec_ != nullptr) tjDestroy(codec_);
}

Status JpegDecoder::Decode(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  HAUSTRA_ASSIGN(const Header header, ReadHeader(codec_, bytes));
  const bool is_grey = header.is_grey || channels == ChannelChoice::kGrey;
  image->Resize(header.size.width_px, header.size.height_px, is_grey ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
  // A progressive file may repeat its scans without end.
  const int flags = kTransform | TJFLAG_LIMITSCANS;
  const int result =
      tjDecompress2(codec_, bytes.data(), bytes.size(), image->row(0), image->width(),
                    static_cast<int>(image->pitch_bytes()), image->height(), is_grey ? TJPF_GRAY : TJPF_BGR, flags);
  return result == 0 || IsOnlyFilledUp(codec_, bytes, header) ? Status::Ok() : Damaged(codec_);
}

Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  return JpegDecoder().Decode(bytes, channels, image);
}

Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes) {
  const Codec codec(tjInitDecompress());
  HAUSTRA_ASSIGN(const Header header, ReadHeader(codec.get(), bytes));
  return header.size;
}

Status EncodeJpeg(ImageView image, int quality, std::vector<std::uint8_t>* bytes) {
  const Codec codec(tjInitCompress());
  if (codec == nullptr) return Internal("TurboJPEG cannot start");
  const bool is_grey = image.format == PixelFormat::kGrey8;
  const int subsampling = is_grey ? TJSAMP_GRAY : quality >= 90 ? TJSAMP_444 : TJSAMP_420;
  unsigned long size = tjBufSize(image.width, image.height, subsampling);  // the library's type
  bytes->resize(size);
  unsigned char* buffer = bytes->data();
  if (tjCompress2(codec.get(), image.data, image.width, static_cast<int>(image.pitch_bytes), image.height,
                  is_grey ? TJPF_GRAY : TJPF_BGR, &buffer, &size, subsampling, quality,
                  kTransform | TJFLAG_NOREALLOC) != 0) {
    return Internal(std::string("JPEG not written: ") + tjGetErrorStr2(codec.get()));
  }
  bytes->resize(size);
  return Status::Ok();
}

}  // namespace haustra::capture::internal
