// Memory of a JPEG decoder from a block of ours. libjpeg asks a struct of functions for all that it needs, and takes it
// from the heap unless these are others'. A thread in real time would wait there for whoever is at the heap.
#pragma once

#include <cstddef>
#include <cstdio>  // which jpeglib.h does without
#include <memory>

#include <jpeglib.h>

namespace haustra::capture::internal {

// Enough for any picture of up to max_width_px that is decoded row by row. One that must be kept as a whole, as it
// comes in several scans (a progressive picture), is refused. thread-bound(the decoder's owner), rt-safe after
// construction.
class JpegMemory {
 public:
  explicit JpegMemory(int max_width_px);
  JpegMemory(const JpegMemory&) = delete;
  JpegMemory& operator=(const JpegMemory&) = delete;

  static std::size_t BytesFor(int max_width_px);

  // What `codec`, which was just created, asks for from now on comes from here; when that is too much libjpeg's
  // error_exit is called. Takes codec->client_data. This must outlive the codec.
  void Serve(jpeg_decompress_struct* codec);
  // Takes everything back, also what the codec would keep from one picture to the next (its tables): it must forget
  // them.
  void Clear();

  // Why the last picture was refused by this memory, null: it was not.
  const char* refusal() const { return refusal_; }
  std::size_t num_used_bytes() const { return num_used_; }

 private:
  struct Functions;  // what libjpeg calls

  // `num_bytes`, aligned for what the library does with vectors. Null: there is not so much left.
  std::byte* Take(std::size_t num_bytes);

  const std::size_t num_bytes_;
  std::unique_ptr<std::byte[]> block_;
  std::byte* begin_ = nullptr;  // aligned
  std::size_t num_used_ = 0;
  const char* refusal_ = nullptr;
};

}  // namespace haustra::capture::internal
