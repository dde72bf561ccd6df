#include "platform/vocabulary_loader.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/place/make_retrieval.h"
#include "engine/place/vocabulary_file.h"

namespace haustra {
namespace {

// More than the largest vocabulary that there can be.
constexpr std::uintmax_t kMaxFileBytes =
    std::uintmax_t{Vocabulary::kMaxNodes} * (kDescriptorBytes + 1 + sizeof(std::uint32_t)) + 4096;

Result<std::vector<std::uint8_t>> ReadFile(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) return NotFound(path + ": there is no such vocabulary file; 'haustra vocabulary' makes one");
  if (!fs::is_regular_file(status)) return Unavailable(path + ": is not a file, but should be a vocabulary");
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) return Unavailable(path + ": cannot be read: " + error.message());
  if (size > kMaxFileBytes) {
    return DataLoss(path + ": " + std::to_string(size) + " bytes are more than any vocabulary has");
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file) return Unavailable(path + ": cannot be read");
  return bytes;
}

}  // namespace

Result<Vocabulary> LoadVocabulary(const std::string& path) {
  HAUSTRA_ASSIGN(const std::vector<std::uint8_t> bytes, ReadFile(path));
  Result<Vocabulary> vocabulary = ReadVocabulary(bytes);
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
