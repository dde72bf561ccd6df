#include "capture/codec/png_codec.h"

#include <png.h>

#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <string>

// Reading has its reasons not to use the simplified interface (../decisions/2026-11-23-png-as-stored.md), and errors
// are reported by a call that must not return. It jumps back to the setjmp of the function that called libpng, and no
// object with a destructor lives in those functions: everything that needs cleaning up belongs to their callers.

namespace haustra::capture::internal {
namespace {

struct PngIo {
  std::span<const std::uint8_t> input;
  std::size_t position = 0;
  char error[200] = "";
};

void OnError(png_structp png, png_const_charp message) {
  auto* io = static_cast<PngIo*>(png_get_error_ptr(png));
  std::snprintf(io->error, sizeof(io->error), "%s", message);
  png_longjmp(png, 1);
}

// Warnings concern ancillary chunks (colour profiles, text), which are not used.
void OnWarning(png_structp, png_const_charp) {}

void ReadBytes(png_structp png, png_bytep data, png_size_t size) {
  auto* io = static_cast<PngIo*>(png_get_io_ptr(png));
  if (size > io->input.size() - io->position) png_error(png, "the file ends too early");
  std::memcpy(data, io->input.data() + io->position, size);
  io->position += size;
}

class ReadHandle {
 public:
  explicit ReadHandle(PngIo* io)
      : png_(png_create_read_struct(PNG_LIBPNG_VER_STRING, io, OnError, OnWarning)),
        info_(png_ == nullptr ? nullptr : png_create_info_struct(png_)) {}
  ~ReadHandle() { png_destroy_read_struct(&png_, &info_, nullptr); }
  ReadHandle(const ReadHandle&) = delete;
  ReadHandle& operator=(const ReadHandle&) = delete;

  bool is_valid() const { return info_ != nullptr; }
  png_structp png() const { return png_; }
  png_infop info() const { return info_; }

 private:
  png_structp png_;
  png_infop info_;
};

bool ReadHeader(png_structp png, png_infop info, PngIo* io) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_read_fn(png, io, ReadBytes);
  png_read_info(png, info);
  return true;
}

// 8-bit grey or 8-bit BGR, whatever is stored.
bool ChooseOutput(png_structp png, png_infop info) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_expand(png);  // palettes to colour, 1, 2 and 4 bits to 8, tRNS to alpha
  png_set_strip_alpha(png);
  png_set_bgr(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
  return true;
}

bool ReadRows(png_structp png, png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_read_image(png, rows);
  png_read_end(png, nullptr);
  return true;
}

Status Damaged(const PngIo& io) { return DataLoss(std::string("damaged PNG file: ") + io.error); }

// The header's size, checked against what the caller can take.
Result<ImageSize> CheckedSize(png_structp png, png_infop info) {
  const png_uint_32 width = png_get_image_width(png, info);
  const png_uint_32 height = png_get_image_height(png, info);
  if (static_cast<std::uint64_t>(width) * height > static_cast<std::uint64_t>(kMaxImagePixels)) {
    return CapacityExceeded(std::to_string(width) + "x" + std::to_string(height) + " pixels are more than " +
                            std::to_string(kMaxImagePixels));
  }
  if (png_get_bit_depth(png, info) == 16) {
    return InvalidArgument("PNG with 16 bits a channel; frames and masks have 8");
  }
  return ImageSize{static_cast<int>(width), static_cast<int>(height)};
}

}  // namespace

bool IsPng(std::span<const std::uint8_t> bytes) {
  constexpr std::uint8_t kSignature[] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  return bytes.size() >= sizeof(kSignature) && std::memcmp(bytes.data(), kSignature, sizeof(kSignature)) == 0;
}

Status DecodePng(std::span<const std::uint8_t> bytes, Image* image) {
  PngIo io;
  io.input = bytes;
  const ReadHandle handle(&io);
  if (!handle.is_valid()) return Internal("libpng cannot start");
  if (!ReadHeader(handle.png(), handle.info(), &io)) return Damaged(io);
  HAUSTRA_ASSIGN(const ImageSize size, CheckedSize(handle.png(), handle.info()));
  if (!ChooseOutput(handle.png(), handle.info())) return Damaged(io);
  const int channels = png_get_channels(handle.png(), handle.info());
  if (channels != 1 && channels != 3) {
    return InvalidArgument("PNG with " + std::to_string(channels) + " channels; 1 or 3 are supported");
  }
  image->Resize(size.width_px, size.height_px, channels == 1 ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
  std::vector<png_bytep> rows(static_cast<std::size_t>(size.height_px));
  for (int y = 0; y < size.height_px; ++y) rows[static_cast<std::size_t>(y)] = image->row(y);
  if (!ReadRows(handle.png(), rows.data())) return Damaged(io);
  return Status::Ok();
}

Result<ImageSize> DecodePngSize(std::span<const std::uint8_t> bytes) {
  PngIo io;
  io.input = bytes;
  const ReadHandle handle(&io);
  if (!handle.is_valid()) return Internal("libpng cannot start");
  if (!ReadHeader(handle.png(), handle.info(), &io)) return Damaged(io);
  return CheckedSize(handle.png(), handle.info());
}

Status EncodePng(ImageView image, std::vector<std::uint8_t>* bytes) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = image.format == PixelFormat::kGrey8 ? PNG_FORMAT_GRAY : PNG_FORMAT_BGR;
  png.flags = PNG_IMAGE_FLAG_FAST;  // a recording must keep up with its camera
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png);
  bytes->resize(size);
  if (png_image_write_to_memory(&png, bytes->data(), &size, 0, image.data, static_cast<png_int_32>(image.pitch_bytes),
                                nullptr) == 0) {
    return Internal(std::string("PNG not written: ") + png.message);
  }
  bytes->resize(size);
  return Status::Ok();
}

}  // namespace haustra::capture::internal
