// Computes all checksums of a chunk file (engine/io/chunk_file.h) anew, as far as its sections can be followed: for
// tests that must get past them, to what is done with the numbers.
#pragma once

#include <zlib.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/io/byte_order.h"
#include "engine/io/chunk_file.h"

namespace haustra::test {

inline void SealFile(std::span<std::uint8_t> file) {
  constexpr std::size_t kMagicBytes = 8, kTagBytes = 4;
  const auto crc_of = [](std::span<const std::uint8_t> bytes, unsigned long crc = 0) {
    return ::crc32_z(crc, bytes.data(), bytes.size());
  };
  const auto put = [&](std::size_t at, unsigned long value) {
    for (std::size_t i = 0; i < 4; ++i) file[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
  };
  if (file.size() < kChunkFileHeaderBytes) return;
  put(kMagicBytes + 4, crc_of(file.first(kMagicBytes + 4)));
  std::uint32_t num_chunks = 0;
  std::string checksums;
  for (std::size_t next = kChunkFileHeaderBytes; next + kChunkHeaderBytes <= file.size();) {
    const std::span<const std::uint8_t> tag = file.subspan(next, kTagBytes);
    const std::uint64_t size = ByteReader(file.subspan(next + 2 * kTagBytes)).U64();
    const std::size_t start = next + kChunkHeaderBytes;
    if (size > file.size() - start) return;
    if (std::string(tag.begin(), tag.end()) == kEndTag && size == 8) {
      put(start, num_chunks);
      put(start + 4, ::crc32(0, reinterpret_cast<const Bytef*>(checksums.data()), static_cast<uInt>(checksums.size())));
    }
    const auto payload = file.subspan(start, static_cast<std::size_t>(size));
    const unsigned long crc = crc_of(payload, crc_of(file.subspan(next + 2 * kTagBytes, 8), crc_of(tag)));
    put(next + kTagBytes, crc);
    ++num_chunks;
    ByteWriter(&checksums).U32(static_cast<std::uint32_t>(crc));
    next = start + static_cast<std::size_t>(size);
  }
}

inline std::vector<std::uint8_t> Sealed(std::span<const std::uint8_t> file) {
  std::vector<std::uint8_t> sealed(file.begin(), file.end());
  SealFile(sealed);
  return sealed;
}

}  // namespace haustra::test
