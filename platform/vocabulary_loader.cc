#include "platform/vocabulary_loader.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "capture/files/whole_file.h"
#include "engine/place/make_retrieval.h"
#include "engine/place/vocabulary_file.h"

namespace haustra {
namespace {

// More than the largest vocabulary that there can be.
constexpr std::size_t kMaxVocabularyBytes =
    std::size_t{Vocabulary::kMaxNodes} * (kDescriptorBytes + 1 + sizeof(std::uint32_t)) + 4096;

}  // namespace

Result<Vocabulary> LoadVocabulary(const std::string& path) {
  const Result<std::vector<std::uint8_t>> bytes = ReadWholeFile(path, kMaxVocabularyBytes);
  if (bytes.code() == StatusCode::kNotFound) {
    return NotFound(bytes.status().message() + "; 'haustra vocabulary' makes a vocabulary");
  }
  if (bytes.code() == StatusCode::kCapacityExceeded) {
    return DataLoss(bytes.status().message() + ", more than any vocabulary has");
  }
  HAUSTRA_TRY(bytes.status());
  Result<Vocabulary> vocabulary = ReadVocabulary(*bytes);
  if (!vocabulary.ok()) return Status(vocabulary.code(), path + ": " + vocabulary.status().message());
  return vocabulary;
}

Result<std::unique_ptr<const Vocabulary>> LoadVocabularyFor(const EngineConfig& config) {
  if (!NeedsVocabulary(config.place.retrieval)) return std::unique_ptr<const Vocabulary>();
  const std::string& path = config.place.retrieval.vocabulary;
  HAUSTRA_ASSIGN(Vocabulary vocabulary, LoadVocabulary(path));
  if (const Status status = CheckVocabulary(config, vocabulary); !status.ok()) {
    return Status(status.code(), path + ": " + status.message());
  }
  return std::unique_ptr<const Vocabulary>(std::make_unique<Vocabulary>(std::move(vocabulary)));
}

}  // namespace haustra
