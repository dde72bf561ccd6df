// A file of sections ("chunks"), each with its size and checksum, so that damage is found wherever it is:
//
//   8 bytes magic, u32 format version, u32 CRC-32 of these 12 bytes
//   any number of sections: 4 letters, u32 CRC-32, u64 payload bytes, payload; the checksum is over letters, size and
//     payload
//   a last section "END ": u32 number of sections before it, u32 CRC-32 over their checksums in order, so that a
//   section
//     that is missing, doubled, moved or taken from another file is found too
//
// All numbers little-endian. CRC-32 (zlib's) finds every error that lies within four bytes, any other with all but one
// chance in 2^32.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "hal/core/byte_sink.h"
#include "hal/core/status.h"

namespace haustra {

// What kind of file it is.
struct ChunkFileKind {
  std::string_view name;   // for messages: "atlas file"
  std::string_view magic;  // 8 bytes
  std::uint32_t version = 0;
};

inline constexpr std::size_t kChunkFileHeaderBytes = 16;
inline constexpr std::size_t kChunkHeaderBytes = 16;
inline constexpr std::string_view kEndTag = "END ";

// thread-bound(the writer), not rt-safe. Errors are those of the sink.
class ChunkWriter {
 public:
  ChunkWriter(const ChunkFileKind& kind, ByteSink& sink) : kind_(kind), sink_(sink) {}

  Status Begin();
  // tag: 4 letters.
  Status Write(std::string_view tag, std::string_view payload);
  Status End();

 private:
  const ChunkFileKind& kind_;
  ByteSink& sink_;
  std::uint32_t num_chunks_ = 0;
  std::string checksums_;
};

struct Chunk {
  std::string_view tag;
  std::span<const std::uint8_t> payload;  // part of the file's bytes
  std::uint64_t offset = 0;               // of the payload in the file
};

// Goes through a whole file in memory, which outlives it. reentrant.
class ChunkReader {
 public:
  ChunkReader(const ChunkFileKind& kind, std::span<const std::uint8_t> file) : kind_(kind), file_(file) {}

  // kInvalidArgument: not such a file; kFailedPrecondition: of another format version; kDataLoss: damaged.
  Status Begin();
  // The next section, its checksum verified; "END " when all sections were there and nothing follows. kDataLoss
  // otherwise; the message names section and offset.
  Result<Chunk> Next();

 private:
  Status Damaged(std::uint64_t offset, const std::string& what) const;

  const ChunkFileKind& kind_;
  std::span<const std::uint8_t> file_;
  std::size_t next_ = 0;
  std::uint32_t num_chunks_ = 0;
  std::string checksums_;
};

}  // namespace haustra
