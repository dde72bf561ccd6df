#include "engine/place/vocabulary_file.h"

#include <string>
#include <string_view>
#include <utility>

#include "engine/io/byte_order.h"

namespace haustra {
namespace {

constexpr std::string_view kHead = "HEAD", kTree = "TREE", kWeights = "WGHT", kCentres = "CNTR";

std::string_view AsText(const std::vector<std::uint8_t>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Status Broken(const std::string& what) { return DataLoss("vocabulary: " + what); }

// The next section, which must be this one and `num_bytes` long.
Result<std::span<const std::uint8_t>> Section(std::string_view tag, std::uint64_t num_bytes, ChunkReader* reader) {
  HAUSTRA_ASSIGN(const Chunk chunk, reader->Next());
  if (chunk.tag != tag) return Broken("no section " + std::string(tag) + " where it should be");
  if (chunk.payload.size() != num_bytes) {
    return Broken("section " + std::string(tag) + " has " + std::to_string(chunk.payload.size()) + " bytes, not " +
                  std::to_string(num_bytes));
  }
  return chunk.payload;
}

}  // namespace

Status WriteVocabulary(const Vocabulary& vocabulary, ByteSink& sink) {
  const VocabularyTree& tree = vocabulary.tree();
  std::string head, weights;
  ByteWriter writer(&head);
  writer.U32(kDescriptorBytes);
  writer.U32(tree.root_sift ? 1 : 0);
  writer.U32(static_cast<std::uint32_t>(tree.branching));
  writer.U32(static_cast<std::uint32_t>(tree.depth));
  writer.U32(static_cast<std::uint32_t>(tree.num_children.size()));
  writer.U32(static_cast<std::uint32_t>(tree.weights.size()));
  writer.U32(tree.num_pictures);
  writer.U64(tree.num_descriptors);
  for (const std::uint32_t weight : tree.weights) ByteWriter(&weights).U32(weight);
  ChunkWriter file(kVocabularyFile, sink);
  HAUSTRA_TRY(file.Begin());
  HAUSTRA_TRY(file.Write(kHead, head));
  HAUSTRA_TRY(file.Write(kTree, AsText(tree.num_children)));
  HAUSTRA_TRY(file.Write(kWeights, weights));
  HAUSTRA_TRY(file.Write(kCentres, AsText(tree.centres)));
  return file.End();
}

Result<Vocabulary> ReadVocabulary(std::span<const std::uint8_t> bytes) {
  constexpr std::uint64_t kHeadBytes = 7 * 4 + 8;
  ChunkReader file(kVocabularyFile, bytes);
  HAUSTRA_TRY(file.Begin());
  HAUSTRA_ASSIGN(const auto head, Section(kHead, kHeadBytes, &file));
  ByteReader reader(head);
  const std::uint32_t descriptor_bytes = reader.U32(), kind = reader.U32(), branching = reader.U32(),
                      depth = reader.U32(), num_nodes = reader.U32(), num_words = reader.U32();
  VocabularyTree tree;
  tree.num_pictures = reader.U32();
  tree.num_descriptors = reader.U64();
  if (descriptor_bytes != kDescriptorBytes) {
    return Broken("descriptors of " + std::to_string(descriptor_bytes) + " bytes, not " +
                  std::to_string(kDescriptorBytes));
  }
  if (kind > 1) return Broken("unknown kind of descriptors " + std::to_string(kind));
  if (branching > Vocabulary::kMaxBranching || depth > Vocabulary::kMaxDepth) {
    return Broken("branching " + std::to_string(branching) + ", depth " + std::to_string(depth) + ": at most " +
                  std::to_string(Vocabulary::kMaxBranching) + " and " + std::to_string(Vocabulary::kMaxDepth));
  }
  if (num_nodes == 0) return Broken("no nodes");
  tree.root_sift = kind == 1;
  tree.branching = static_cast<int>(branching);
  tree.depth = static_cast<int>(depth);
  HAUSTRA_ASSIGN(const auto num_children, Section(kTree, num_nodes, &file));
  HAUSTRA_ASSIGN(const auto weights, Section(kWeights, std::uint64_t{4} * num_words, &file));
  HAUSTRA_ASSIGN(const auto centres, Section(kCentres, std::uint64_t{kDescriptorBytes} * (num_nodes - 1), &file));
  HAUSTRA_TRY(Section(kEndTag, 8, &file).status());
  tree.num_children.assign(num_children.begin(), num_children.end());
  tree.weights.resize(num_words);
  ByteReader weight_reader(weights);
  for (std::uint32_t& weight : tree.weights) weight = weight_reader.U32();
  tree.centres.assign(centres.begin(), centres.end());
  Result<Vocabulary> vocabulary = Vocabulary::FromTree(std::move(tree));
  if (!vocabulary.ok()) return DataLoss(vocabulary.status().message());
  return vocabulary;
}

}  // namespace haustra
