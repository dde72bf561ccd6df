// A vocabulary as bytes, to be kept in a file: sections of engine/io/chunk_file.h, each with its checksum, numbers
// little-endian.
//   HEAD  u32 bytes of a descriptor (128), u32 kind of the descriptors (0 SIFT, 1 RootSIFT), u32 branching, u32 depth,
//         u32 nodes, u32 words, u32 pictures and u64 descriptors that it was trained on
//   TREE  u8 children of each node
//   WGHT  u32 weight of each word
//   CNTR  128 bytes for each node but the root
// See VocabularyTree for the meaning. The engine knows no file system: whoever calls reads and writes the file.
// reentrant. Allocates.
#pragma once

#include <cstdint>
#include <span>

#include "engine/io/chunk_file.h"
#include "engine/place/vocabulary.h"
#include "hal/core/byte_sink.h"
#include "hal/core/status.h"

namespace haustra {

inline constexpr ChunkFileKind kVocabularyFile{"vocabulary", "HAUSTVOC", 1};

// Errors are those of the sink.
Status WriteVocabulary(const Vocabulary& vocabulary, ByteSink& sink);

// kInvalidArgument: not a vocabulary; kFailedPrecondition: of another version of the format; kDataLoss: cut off, too
// long, damaged, or no tree (whatever the checksums say). The message says what is wrong and where; the caller adds the
// name of the file. Nothing is allocated that the length of the bytes does not warrant.
Result<Vocabulary> ReadVocabulary(std::span<const std::uint8_t> bytes);

}  // namespace haustra
