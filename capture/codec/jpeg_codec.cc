#include "capture/codec/jpeg_codec.h"

#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <jpeglib.h>  // after <cstdio>: it uses FILE without including it

// libjpeg reports errors by a call that must not return. It jumps back to the setjmp of the function that called
// libjpeg, and no object with a destructor lives in those functions: everything that needs cleaning up belongs to their
// callers.

namespace haustra::capture::internal {
namespace {

// A progressive file may repeat its scans without end; real ones have about ten.
constexpr int kMaxScans = 100;

struct ErrorSink {
  jpeg_error_mgr base;  // first: libjpeg knows only this part
  std::jmp_buf on_error;
  bool has_warning;
  char message[JMSG_LENGTH_MAX];
};

ErrorSink* SinkOf(j_common_ptr codec) { return reinterpret_cast<ErrorSink*>(codec->err); }

[[noreturn]] void OnError(j_common_ptr codec) {
  ErrorSink* sink = SinkOf(codec);
  codec->err->format_message(codec, sink->message);
  std::longjmp(sink->on_error, 1);
}

void OnMessage(j_common_ptr codec, int level) {
  ErrorSink* sink = SinkOf(codec);
  if (level >= 0 || sink->has_warning) return;  // trace output, or not the first warning
  sink->has_warning = true;
  codec->err->format_message(codec, sink->message);
}

void OnOutput(j_common_ptr) {}

void OnProgress(j_common_ptr codec) {
  if (codec->is_decompressor == 0) return;
  if (reinterpret_cast<j_decompress_ptr>(codec)->input_scan_number <= kMaxScans) return;
  ErrorSink* sink = SinkOf(codec);
  std::snprintf(sink->message, sizeof(sink->message), "more than %d scans", kMaxScans);
  std::longjmp(sink->on_error, 1);
}

void InitSink(ErrorSink* sink) {
  std::memset(sink, 0, sizeof(*sink));
  jpeg_std_error(&sink->base);
  sink->base.error_exit = OnError;
  sink->base.emit_message = OnMessage;
  sink->base.output_message = OnOutput;
}

struct Decoder {
  jpeg_decompress_struct codec{};
  jpeg_progress_mgr progress{};
  ErrorSink sink;

  Decoder() {
    InitSink(&sink);
    codec.err = &sink.base;
    progress.progress_monitor = OnProgress;
  }
  ~Decoder() { jpeg_destroy_decompress(&codec); }  // does nothing when the codec was never created
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  Status Damaged() const { return DataLoss(std::string("damaged JPEG file: ") + sink.message); }
};

struct Encoder {
  jpeg_compress_struct codec{};
  ErrorSink sink;
  unsigned char* buffer = nullptr;  // malloc'ed by libjpeg
  unsigned long size = 0;           // NOLINT(google-runtime-int): libjpeg's type

  Encoder() {
    InitSink(&sink);
    codec.err = &sink.base;
  }
  ~Encoder() {
    jpeg_destroy_compress(&codec);
    std::free(buffer);
  }
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;
};

bool ReadHeader(Decoder* decoder, const std::uint8_t* data, std::size_t size) {
  if (setjmp(decoder->sink.on_error) != 0) return false;
  jpeg_create_decompress(&decoder->codec);
  decoder->codec.progress = &decoder->progress;
  jpeg_mem_src(&decoder->codec, data, size);
  return jpeg_read_header(&decoder->codec, TRUE) == JPEG_HEADER_OK;
}

bool ReadRows(Decoder* decoder, J_COLOR_SPACE color_space, Image* image) {
  if (setjmp(decoder->sink.on_error) != 0) return false;
  decoder->codec.out_color_space = color_space;
  // Part of the answer, bit for bit: the same exact integer transform in every build.
  decoder->codec.dct_method = JDCT_ISLOW;
  jpeg_start_decompress(&decoder->codec);
  while (decoder->codec.output_scanline < decoder->codec.output_height) {
    JSAMPROW row = image->row(static_cast<int>(decoder->codec.output_scanline));
    jpeg_read_scanlines(&decoder->codec, &row, 1);
  }
  jpeg_finish_decompress(&decoder->codec);
  return true;
}

bool WriteAll(Encoder* encoder, const ImageView& image, int quality) {
  if (setjmp(encoder->sink.on_error) != 0) return false;
  jpeg_create_compress(&encoder->codec);
  jpeg_mem_dest(&encoder->codec, &encoder->buffer, &encoder->size);
  encoder->codec.image_width = static_cast<JDIMENSION>(image.width);
  encoder->codec.image_height = static_cast<JDIMENSION>(image.height);
  encoder->codec.input_components = BytesPerPixel(image.format);
  encoder->codec.in_color_space = image.format == PixelFormat::kGrey8 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  jpeg_set_defaults(&encoder->codec);
  jpeg_set_quality(&encoder->codec, quality, TRUE);
  encoder->codec.dct_method = JDCT_ISLOW;
  if (quality >= 90 && image.format == PixelFormat::kBgr8) {
    encoder->codec.comp_info[0].h_samp_factor = 1;
    encoder->codec.comp_info[0].v_samp_factor = 1;
  }
  jpeg_start_compress(&encoder->codec, TRUE);
  while (encoder->codec.next_scanline < encoder->codec.image_height) {
    // libjpeg takes rows to write as mutable pointers and does not change them.
    JSAMPROW row = const_cast<JSAMPROW>(image.row(static_cast<int>(encoder->codec.next_scanline)));
    jpeg_write_scanlines(&encoder->codec, &row, 1);
  }
  jpeg_finish_compress(&encoder->codec);
  return true;
}

Result<ImageSize> CheckedSize(const jpeg_decompress_struct& codec) {
  if (static_cast<std::uint64_t>(codec.image_width) * codec.image_height >
      static_cast<std::uint64_t>(kMaxImagePixels)) {
    return CapacityExceeded(std::to_string(codec.image_width) + "x" + std::to_string(codec.image_height) +
                            " pixels are more than " + std::to_string(kMaxImagePixels));
  }
  return ImageSize{static_cast<int>(codec.image_width), static_cast<int>(codec.image_height)};
}

}  // namespace

bool IsJpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  Decoder decoder;
  if (!ReadHeader(&decoder, bytes.data(), bytes.size())) return decoder.Damaged();
  HAUSTRA_ASSIGN(const ImageSize size, CheckedSize(decoder.codec));
  const J_COLOR_SPACE stored = decoder.codec.jpeg_color_space;
  if (stored != JCS_GRAYSCALE && stored != JCS_YCbCr && stored != JCS_RGB) {
    return InvalidArgument("JPEG with " + std::to_string(decoder.codec.num_components) +
                           " channels that are neither grey nor YCbCr nor RGB");
  }
  const bool grey = stored == JCS_GRAYSCALE || channels == ChannelChoice::kGrey;
  image->Resize(size.width_px, size.height_px, grey ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
  if (!ReadRows(&decoder, grey ? JCS_GRAYSCALE : JCS_EXT_BGR, image)) return decoder.Damaged();
  if (decoder.sink.has_warning) return decoder.Damaged();
  return Status::Ok();
}

Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes) {
  Decoder decoder;
  if (!ReadHeader(&decoder, bytes.data(), bytes.size())) return decoder.Damaged();
  return CheckedSize(decoder.codec);
}

Status EncodeJpeg(ImageView image, int quality, std::vector<std::uint8_t>* bytes) {
  Encoder encoder;
  if (!WriteAll(&encoder, image, quality)) return Internal(std::string("JPEG not written: ") + encoder.sink.message);
  bytes->assign(encoder.buffer, encoder.buffer + encoder.size);
  return Status::Ok();
}

}  // namespace haustra::capture::internal
