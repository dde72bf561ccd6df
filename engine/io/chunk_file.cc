#include "engine/io/chunk_file.h"

#include <zlib.h>

#include <algorithm>
#include <cctype>

#include "engine/io/byte_order.h"

namespace haustra {
namespace {

constexpr std::size_t kMagicBytes = 8;
constexpr std::size_t kTagBytes = 4;

std::uint32_t Crc(std::span<const std::uint8_t> bytes, std::uint32_t crc = 0) {
  // What is empty may lie nowhere: for a null pointer zlib answers 0, whatever came before.
  if (bytes.empty()) return crc;
  return static_cast<std::uint32_t>(::crc32_z(crc, bytes.data(), bytes.size()));
}

std::span<const std::uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::uint32_t ChunkCrc(std::string_view tag, std::span<const std::uint8_t> payload) {
  std::string head(tag);
  ByteWriter(&head).U64(payload.size());
  return Crc(payload, Crc(AsBytes(head)));
}

// Damaged bytes must not reach a terminal.
std::string Printable(std::string_view tag) {
  std::string text;
  for (const char c : tag) text += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?';
  return text;
}

}  // namespace

Status ChunkWriter::Begin() {
  std::string header(kind_.magic);
  ByteWriter writer(&header);
  writer.U32(kind_.version);
  writer.U32(Crc(AsBytes(header)));
  return sink_.Write(header);
}

Status ChunkWriter::Write(std::string_view tag, std::string_view payload) {
  const std::uint32_t crc = ChunkCrc(tag, AsBytes(payload));
  std::string header(tag);
  ByteWriter writer(&header);
  writer.U32(crc);
  writer.U64(payload.size());
  HAUSTRA_TRY(sink_.Write(header));
  ++num_chunks_;
  ByteWriter(&checksums_).U32(crc);
  return sink_.Write(payload);
}

Status ChunkWriter::End() {
  std::string payload;
  ByteWriter writer(&payload);
  writer.U32(num_chunks_);
  writer.U32(Crc(AsBytes(checksums_)));
  return Write(kEndTag, payload);
}

Status ChunkReader::Damaged(std::uint64_t offset, const std::string& what) const {
  return DataLoss(std::string(kind_.name) + " is damaged at byte " + std::to_string(offset) + ": " + what);
}

Status ChunkReader::Begin() {
  if (file_.size() < kMagicBytes || !std::equal(kind_.magic.begin(), kind_.magic.end(), file_.begin(),
                                                [](char a, std::uint8_t b) { return static_cast<char>(b) == a; })) {
    return InvalidArgument("no " + std::string(kind_.name) + ": it does not begin as one (" +
                           std::to_string(file_.size()) + " bytes)");
  }
  if (file_.size() < kChunkFileHeaderBytes) return Damaged(file_.size(), "ends within its header");
  ByteReader reader(file_.subspan(kMagicBytes));
  const std::uint32_t version = reader.U32();
  if (reader.U32() != Crc(file_.first(kMagicBytes + 4))) return Damaged(kMagicBytes, "checksum of the header is wrong");
  if (version != kind_.version) {
    return FailedPrecondition(std::string(kind_.name) + " has format version " + std::to_string(version) +
                              ", this program reads version " + std::to_string(kind_.version));
  }
  next_ = kChunkFileHeaderBytes;
  return Status::Ok();
}

Result<Chunk> ChunkReader::Next() {
  const std::size_t start = next_;
  ByteReader reader(file_.subspan(start), start);
  const std::span<const std::uint8_t> tag = reader.Bytes(kTagBytes);
  const std::uint32_t crc = reader.U32();
  const std::uint64_t size = reader.U64();
  if (reader.is_short()) return Damaged(file_.size(), "ends before its last section");
  Chunk chunk;
  chunk.tag = std::string_view(reinterpret_cast<const char*>(tag.data()), tag.size());
  chunk.offset = reader.offset();
  const std::string name = "section '" + Printable(chunk.tag) + "' of " + std::to_string(size) + " bytes ";
  if (size > reader.num_left()) {
    return Damaged(start, name + "ends beyond the file's " + std::to_string(file_.size()) + " bytes");
  }
  chunk.payload = reader.Bytes(static_cast<std::size_t>(size));
  if (crc != ChunkCrc(chunk.tag, chunk.payload)) return Damaged(start, name + "has a wrong checksum");
  next_ = static_cast<std::size_t>(reader.offset());
  if (chunk.tag == kEndTag) {
    ByteReader end(chunk.payload);
    if (chunk.payload.size() != 8 || end.U32() != num_chunks_ || end.U32() != Crc(AsBytes(checksums_))) {
      return Damaged(start, "the sections are not those that were written");
    }
    if (next_ != file_.size()) {
      return Damaged(next_, std::to_string(file_.size() - next_) + " bytes follow the last section");
    }
  }
  ++num_chunks_;
  ByteWriter(&checksums_).U32(crc);
  return chunk;
}

}  // namespace haustra
