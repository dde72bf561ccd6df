#include "capture/codec/jpeg_codec.h"

#include <csetjmp>
#include <cstdio>  // which jpeglib.h does without
#include <memory>
#include <string>

#include <jerror.h>
#include <jpeglib.h>
#include <turbojpeg.h>

#include "capture/codec/jpeg_memory.h"

// Pictures are read by libjpeg's interface, which can be given memory, and written by the shorter one of TurboJPEG.
// libjpeg's errors come by a call that must not return. It jumps back to the setjmp of the function that called the
// library, and no object with a destructor lives in between.
namespace haustra::capture::internal {
namespace {

constexpr int kEndMarker = 0xd9;
constexpr int kMaxScans = 500;  // of a progressive file, which may repeat them without end

struct Closer {
  void operator()(void* codec) const { tjDestroy(codec); }
};
using Encoder = std::unique_ptr<void, Closer>;

std::string SizeText(ImageSize size) { return std::to_string(size.width_px) + "x" + std::to_string(size.height_px); }

}  // namespace

// What the library has to say about a picture.
struct JpegFaults : jpeg_error_mgr {
  std::jmp_buf giving_up;
  int num_faults;  // errors, and warnings that count
  char first[JMSG_LENGTH_MAX];

  static JpegFaults& Of(j_common_ptr codec) { return static_cast<JpegFaults&>(*codec->err); }

  static void Note(j_common_ptr codec) {
    JpegFaults& faults = Of(codec);
    if (faults.num_faults++ == 0) faults.format_message(codec, faults.first);
  }
  [[noreturn]] static void GiveUp(j_common_ptr codec) {
    Note(codec);
    std::longjmp(Of(codec).giving_up, 1);
  }
  // Bytes before the end marker are no damage: all blocks were read by then. Where a restart marker was due, or blocks
  // are missing, the library warns of that, too.
  static void Warn(j_common_ptr codec, int level) {
    if (level >= 0) return;  // it only tells what it does
    const JpegFaults& faults = Of(codec);
    const bool is_filled_up = faults.msg_code == JWRN_EXTRANEOUS_DATA && faults.msg_parm.i[1] == kEndMarker;
    if (!is_filled_up) Note(codec);
  }
  static void LimitScans(j_common_ptr codec) {
    if (reinterpret_cast<j_decompress_ptr>(codec)->input_scan_number <= kMaxScans) return;
    JpegFaults& faults = Of(codec);
    if (faults.num_faults++ == 0) std::snprintf(faults.first, sizeof faults.first, "more than %d scans", kMaxScans);
    std::longjmp(faults.giving_up, 1);
  }
};

// One picture after the other; each is read as if it were the first.
class LibjpegDecoder {
 public:
  // Null: the library takes its memory from the heap.
  explicit LibjpegDecoder(JpegMemory* memory) : memory_(memory) {
    library_.err = jpeg_std_error(&faults_);
    faults_.error_exit = JpegFaults::GiveUp;
    faults_.emit_message = JpegFaults::Warn;
    is_created_ = Create();
    if (!is_created_) return;
    progress_.progress_monitor = JpegFaults::LimitScans;
    library_.progress = &progress_;
    if (memory_ != nullptr) memory_->Serve(&library_);
  }
  ~LibjpegDecoder() { jpeg_destroy_decompress(&library_); }
  LibjpegDecoder(const LibjpegDecoder&) = delete;
  LibjpegDecoder& operator=(const LibjpegDecoder&) = delete;

  // The bytes are read again by ReadPicture.
  Result<ImageSize> ReadHeader(std::span<const std::uint8_t> bytes) {
    if (!is_created_) return Internal("libjpeg cannot start");
    if (!Begin(bytes) || faults_.num_faults > 0) return Damaged();
    const ImageSize size{static_cast<int>(library_.image_width), static_cast<int>(library_.image_height)};
    if (std::int64_t{size.width_px} * size.height_px > kMaxImagePixels) {
      return CapacityExceeded(SizeText(size) + " pixels are more than " + std::to_string(kMaxImagePixels));
    }
    const J_COLOR_SPACE colours = library_.jpeg_color_space;
    if (colours != JCS_GRAYSCALE && colours != JCS_YCbCr && colours != JCS_RGB) {
      return InvalidArgument("JPEG with " + std::to_string(library_.num_components) +
                             " channels; grey, YCbCr and RGB are supported");
    }
    if (library_.data_precision != BITS_IN_JSAMPLE) {
      return InvalidArgument("JPEG with " + std::to_string(library_.data_precision) +
                             " bits a channel; 8 are supported");
    }
    return size;
  }

  // After ReadHeader.
  Status ReadPicture(ImageSize size, ChannelChoice channels, Image* image) {
    const bool is_grey = library_.jpeg_color_space == JCS_GRAYSCALE || channels == ChannelChoice::kGrey;
    image->Resize(size.width_px, size.height_px, is_grey ? PixelFormat::kGrey8 : PixelFormat::kBgr8);
    library_.out_color_space = is_grey ? JCS_GRAYSCALE : JCS_EXT_BGR;
    // Part of the answer, bit for bit: the same exact integer transform in every build.
    library_.dct_method = JDCT_ISLOW;
    return ReadRows(image->row(0), image->pitch_bytes()) && faults_.num_faults == 0 ? Status::Ok() : Damaged();
  }

 private:
  bool Create() {
    if (setjmp(faults_.giving_up) != 0) return false;
    jpeg_create_decompress(&library_);
    return true;
  }

  bool Begin(std::span<const std::uint8_t> bytes) {
    faults_.num_faults = 0;
    if (setjmp(faults_.giving_up) != 0) return false;
    jpeg_abort_decompress(&library_);
    if (memory_ != nullptr) {
      memory_->Clear();
      library_.src = nullptr;
      for (JQUANT_TBL*& table : library_.quant_tbl_ptrs) table = nullptr;
      for (JHUFF_TBL*& table : library_.dc_huff_tbl_ptrs) table = nullptr;
      for (JHUFF_TBL*& table : library_.ac_huff_tbl_ptrs) table = nullptr;
    }
    jpeg_mem_src(&library_, bytes.data(), bytes.size());
    jpeg_read_header(&library_, TRUE);
    return true;
  }

  bool ReadRows(std::uint8_t* first, std::ptrdiff_t pitch_bytes) {
    if (setjmp(faults_.giving_up) != 0) return false;
    jpeg_start_decompress(&library_);
    while (library_.output_scanline < library_.output_height) {
      JSAMPROW row = first + static_cast<std::ptrdiff_t>(library_.output_scanline) * pitch_bytes;
      jpeg_read_scanlines(&library_, &row, 1);
    }
    jpeg_finish_decompress(&library_);
    return true;
  }

  Status Damaged() const {
    if (memory_ != nullptr && memory_->refusal() != nullptr) {
      return CapacityExceeded(std::string("JPEG picture: ") + memory_->refusal());
    }
    return DataLoss(std::string("damaged JPEG file: ") + faults_.first);
  }

  JpegMemory* const memory_;
  bool is_created_ = false;
  JpegFaults faults_{};
  jpeg_progress_mgr progress_{};
  jpeg_decompress_struct library_{};
};

bool IsJpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 3 && bytes[0] == 0xff && bytes[1] == 0xd8 && bytes[2] == 0xff;
}

JpegDecoder::JpegDecoder(ImageSize largest)
    : largest_(largest),
      memory_(std::make_unique<JpegMemory>(largest.width_px)),
      decoder_(std::make_unique<LibjpegDecoder>(memory_.get())) {}

JpegDecoder::~JpegDecoder() = default;

Status JpegDecoder::Decode(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  HAUSTRA_ASSIGN(const ImageSize size, decoder_->ReadHeader(bytes));
  if (size.width_px > largest_.width_px || size.height_px > largest_.height_px) {
    return CapacityExceeded("a picture of " + SizeText(size) + ", larger than " + SizeText(largest_));
  }
  return decoder_->ReadPicture(size, channels, image);
}

Status DecodeJpeg(std::span<const std::uint8_t> bytes, ChannelChoice channels, Image* image) {
  LibjpegDecoder decoder(nullptr);
  HAUSTRA_ASSIGN(const ImageSize size, decoder.ReadHeader(bytes));
  return decoder.ReadPicture(size, channels, image);
}

Result<ImageSize> DecodeJpegSize(std::span<const std::uint8_t> bytes) {
  return LibjpegDecoder(nullptr).ReadHeader(bytes);
}

Status EncodeJpeg(ImageView image, int quality, std::vector<std::uint8_t>* bytes) {
  const Encoder codec(tjInitCompress());
  if (codec == nullptr) return Internal("TurboJPEG cannot start");
  const bool is_grey = image.format == PixelFormat::kGrey8;
  const int subsampling = is_grey ? TJSAMP_GRAY : quality >= 90 ? TJSAMP_444 : TJSAMP_420;
  unsigned long size = tjBufSize(image.width, image.height, subsampling);  // the library's type
  bytes->resize(size);
  unsigned char* buffer = bytes->data();
  if (tjCompress2(codec.get(), image.data, image.width, static_cast<int>(image.pitch_bytes), image.height,
                  is_grey ? TJPF_GRAY : TJPF_BGR, &buffer, &size, subsampling, quality,
                  TJFLAG_ACCURATEDCT | TJFLAG_NOREALLOC) != 0) {
    return Internal(std::string("JPEG not written: ") + tjGetErrorStr2(codec.get()));
  }
  bytes->resize(size);
  return Status::Ok();
}

}  // namespace haustra::capture::internal
