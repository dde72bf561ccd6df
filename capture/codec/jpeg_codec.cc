#include "capture/codec/jpeg_codec.h"

#include <memory>
#include <string>

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
};

Status Damaged(const Codec& codec) {
  return DataLoss(std::string("damaged JPEG file: ") + tjGetErrorStr2(codec.get()));
}

Result<Header> ReadHeader(const Codec& codec, std::span<const std::uint8_t> bytes) {
  if (codec == nullptr) return Internal("TurboJPEG cannot start");
  int width = 0, height = 0, subsampling = 0, colours = 0;
  if (tjDecompressHeader3(codec.get(), bytes.data(), bytes.size(), &width, &height, &subsampling, &colours) != 0) {
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
  return Header{{width, height}, colours == TJCS_GRAY};
}

}  // namespace

bool IsJpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  const Codec codec(tjInitDecompress());
  HAUSTRA_ASSIGN(const Header header, ReadHeader(codec, bytes));
  const bool is_grey = header.is_grey || channels == ChannelChoice::kGrey;
  image->Resize(header.size.width_px, header.size.height_px, is_grey ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
  // A progressive file may repeat its scans without end.
  const int flags = kTransform | TJFLAG_LIMITSCANS | TJFLAG_STOPONWARNING;
  const int result =
      tjDecompress2(codec.get(), bytes.data(), bytes.size(), image->row(0), image->width(),
                    static_cast<int>(image->pitch_bytes()), image->height(), is_grey ? TJPF_GRAY : TJPF_BGR, flags);
  return result == 0 ? Status::Ok() : Damaged(codec);
}

Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes) {
  const Codec codec(tjInitDecompress());
  HAUSTRA_ASSIGN(const Header header, ReadHeader(codec, bytes));
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
