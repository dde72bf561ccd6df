#include "capture/codec/jpeg_memory.h"

#include <cstdint>
#include <limits>

#include <jerror.h>

namespace haustra::capture::internal {
namespace {

// libjpeg-turbo's own memory begins at multiples of 32 bytes and ends at them, rows of samples at multiples of 64. Its
// vector code may touch what lies between the end of a row and that. Twice as much, should vectors grow.
constexpr std::size_t kAlignment = 64;
constexpr std::size_t kRowAlignment = 128;
// What does not depend on the width: the modules, and tables for up to three components. 26 KB in libjpeg-turbo 2.1.
constexpr std::size_t kFixedBytes = 64 << 10;
// Rows of samples. A picture has at most ten blocks of 8 rows in the smallest unit that it is decoded by. The library
// keeps ten rows for eight (the context of upsampling), and up to four for each component after upsampling.
constexpr std::size_t kMaxRows = 10 * 10 + 3 * 4;
constexpr std::size_t kMaxUnitWidth = 32;  // that the width is rounded up to

constexpr const char* kNoRoom = "it needs more memory than its width does";
constexpr const char* kManyScans = "its scans would have to be kept as a whole";

std::size_t AlignUp(std::size_t size, std::size_t alignment) { return (size + alignment - 1) / alignment * alignment; }

}  // namespace

struct JpegMemory::Functions {
  static JpegMemory& Of(j_common_ptr codec) { return *static_cast<JpegMemory*>(codec->client_data); }

  // error_exit does not return.
  static void* Refuse(j_common_ptr codec, const char* reason) {
    Of(codec).refusal_ = reason;
    codec->err->msg_code = JERR_OUT_OF_MEMORY;
    codec->err->msg_parm.i[0] = 0;
    codec->err->error_exit(codec);
    return nullptr;
  }

  static void* Allocate(j_common_ptr codec, int /*pool*/, std::size_t num_bytes) {
    std::byte* const memory = Of(codec).Take(num_bytes);
    return memory != nullptr ? memory : Refuse(codec, kNoRoom);
  }

  template <typename Row>
  static Row* AllocateRows(j_common_ptr codec, std::size_t row_bytes, JDIMENSION num_rows) {
    if (row_bytes > std::numeric_limits<std::uint32_t>::max()) Refuse(codec, kNoRoom);
    row_bytes = AlignUp(row_bytes, kRowAlignment);
    auto* const rows = static_cast<Row*>(Allocate(codec, 0, num_rows * sizeof(Row)));
    auto* const memory = static_cast<std::byte*>(Allocate(codec, 0, num_rows * row_bytes));
    for (JDIMENSION i = 0; i < num_rows; ++i) rows[i] = reinterpret_cast<Row>(memory + i * row_bytes);
    return rows;
  }
  static JSAMPARRAY AllocateSamples(j_common_ptr codec, int /*pool*/, JDIMENSION row_samples, JDIMENSION num_rows) {
    return AllocateRows<JSAMPROW>(codec, row_samples * sizeof(JSAMPLE), num_rows);
  }
  static JBLOCKARRAY AllocateBlocks(j_common_ptr codec, int /*pool*/, JDIMENSION row_blocks, JDIMENSION num_rows) {
    return AllocateRows<JBLOCKROW>(codec, row_blocks * sizeof(JBLOCK), num_rows);
  }

  static jvirt_sarray_ptr KeepSamples(j_common_ptr codec, int, boolean, JDIMENSION, JDIMENSION, JDIMENSION) {
    return static_cast<jvirt_sarray_ptr>(Refuse(codec, kManyScans));
  }
  static jvirt_barray_ptr KeepBlocks(j_common_ptr codec, int, boolean, JDIMENSION, JDIMENSION, JDIMENSION) {
    return static_cast<jvirt_barray_ptr>(Refuse(codec, kManyScans));
  }

  // After each picture; Clear takes back what there is.
  static void FreePool(j_common_ptr /*codec*/, int /*pool*/) {}
};

JpegMemory::JpegMemory(int max_width_px)
    : num_bytes_(BytesFor(max_width_px)), block_(std::make_unique<std::byte[]>(num_bytes_ + kAlignment)) {
  const std::size_t misfit = reinterpret_cast<std::uintptr_t>(block_.get()) % kAlignment;
  begin_ = block_.get() + (kAlignment - misfit) % kAlignment;
}

std::size_t JpegMemory::BytesFor(int max_width_px) {
  return kFixedBytes + kMaxRows * AlignUp(static_cast<std::size_t>(max_width_px) + kMaxUnitWidth, kRowAlignment);
}

void JpegMemory::Serve(jpeg_decompress_struct* codec) {
  codec->client_data = this;
  jpeg_memory_mgr& functions = *codec->mem;
  functions.alloc_small = Functions::Allocate;
  functions.alloc_large = Functions::Allocate;
  functions.alloc_sarray = Functions::AllocateSamples;
  functions.alloc_barray = Functions::AllocateBlocks;
  functions.request_virt_sarray = Functions::KeepSamples;
  functions.request_virt_barray = Functions::KeepBlocks;
  // The others do nothing without such arrays. self_destruct gives back what the codec took when it was created.
  functions.free_pool = Functions::FreePool;
}

void JpegMemory::Clear() {
  num_used_ = 0;
  refusal_ = nullptr;
}

std::byte* JpegMemory::Take(std::size_t num_bytes) {
  if (num_bytes > num_bytes_ - num_used_) return nullptr;
  num_bytes = AlignUp(num_bytes, kAlignment);
  if (num_bytes > num_bytes_ - num_used_) return nullptr;
  std::byte* const memory = begin_ + num_used_;
  num_used_ += num_bytes;
  return memory;
}

}  // namespace haustra::capture::internal
