#include <array>
#include <string>

#include "engine/place/vocabulary_file.h"
#include "hal/core/check.h"
#include "tests/engine/io/sealed_file.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {
namespace {

void TryVocabulary(std::span<const std::uint8_t> bytes) {
  const Result<Vocabulary> vocabulary = ReadVocabulary(bytes);
  if (!vocabulary.ok()) {
    HAUSTRA_CHECK(!vocabulary.status().message().empty());
    return;
  }
  for (const std::uint8_t value : {0, 127, 255}) {
    std::array<std::uint8_t, kDescriptorBytes> descriptor;
    descriptor.fill(value);
    const std::int32_t word = vocabulary->WordOf(descriptor.data());
    HAUSTRA_CHECK(word >= 0 && word < vocabulary->num_words());
    HAUSTRA_CHECK(vocabulary->weight(word) <= Vocabulary::kMaxWeight);
  }
  // What was taken is written as it came.
  StringSink sink;
  HAUSTRA_CHECK(WriteVocabulary(*vocabulary, sink).ok());
  HAUSTRA_CHECK(sink.bytes() == std::string(bytes.begin(), bytes.end()));
}

}  // namespace

void FuzzVocabulary(std::span<const std::uint8_t> bytes) {
  TryVocabulary(bytes);
  TryVocabulary(Sealed(bytes));
}

}  // namespace haustra::test
