#include "engine/place/vocabulary_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tests/engine/place/synthetic_words.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

Vocabulary SmallVocabulary() {
  VocabularyOptions options;
  options.branching = 3;
  options.depth = 2;
  options.root_sift = true;
  return Vocabulary::Train(ClusteredSample(1, 12, 3, 4), options).value();
}

std::span<const std::uint8_t> AsBytes(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}
std::string FileOf(const Vocabulary& vocabulary) {
  StringSink sink;
  EXPECT_TRUE(WriteVocabulary(vocabulary, sink).ok());
  return sink.bytes();
}
Result<Vocabulary> Read(std::string_view text) { return ReadVocabulary(AsBytes(text)); }

// The sections of a file, to be changed and written again with right checksums.
using Sections = std::vector<std::pair<std::string, std::string>>;

Sections SectionsOf(const std::string& bytes) {
  ChunkReader reader(kVocabularyFile, AsBytes(bytes));
  EXPECT_TRUE(reader.Begin().ok());
  Sections sections;
  while (true) {
    const Chunk chunk = reader.Next().value();
    if (chunk.tag == kEndTag) return sections;
    sections.emplace_back(chunk.tag, std::string(chunk.payload.begin(), chunk.payload.end()));
  }
}
std::string FileOf(const Sections& sections) {
  StringSink sink;
  ChunkWriter writer(kVocabularyFile, sink);
  EXPECT_TRUE(writer.Begin().ok());
  for (const auto& [tag, payload] : sections) EXPECT_TRUE(writer.Write(tag, payload).ok());
  EXPECT_TRUE(writer.End().ok());
  return sink.bytes();
}

TEST(VocabularyFile, WhatIsReadIsWhatWasWritten) {
  const Vocabulary vocabulary = SmallVocabulary();
  const std::string bytes = FileOf(vocabulary);
  const Result<Vocabulary> read = Read(bytes);
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_EQ(FileOf(*read), bytes);
  EXPECT_TRUE(read->tree().root_sift);
  EXPECT_EQ(read->tree().num_pictures, 3u);
  EXPECT_EQ(read->tree().num_descriptors, 144u);
  const VocabularySample sample = ClusteredSample(2, 50, 1, 2);
  for (std::size_t i = 0; i < sample.num_descriptors(); ++i) {
    const std::uint8_t* const descriptor = &sample.descriptors[i * kDescriptorBytes];
    EXPECT_EQ(read->WordOf(descriptor), vocabulary.WordOf(descriptor));
  }
  for (std::int32_t word = 0; word < read->num_words(); ++word) EXPECT_EQ(read->weight(word), vocabulary.weight(word));
}

// It has no centres: what is empty may lie nowhere when it is written, and lies in the file when it is read.
TEST(VocabularyFile, OfOneWordIsReadBack) {
  VocabularySample sample;
  sample.descriptors.assign(10 * kDescriptorBytes, 7);
  sample.picture_ends = {5, 10};
  const Vocabulary vocabulary = Vocabulary::Train(sample, {}).value();
  ASSERT_EQ(vocabulary.tree().centres.data(), nullptr);
  const std::string bytes = FileOf(vocabulary);
  const Result<Vocabulary> read = Read(bytes);
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_EQ(read->num_words(), 1);
  EXPECT_EQ(FileOf(*read), bytes);
}

TEST(VocabularyFile, CutOffAtAnyLengthIsRefused) {
  const std::string bytes = FileOf(SmallVocabulary());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    ASSERT_FALSE(Read(std::string_view(bytes).substr(0, length)).ok()) << length;
  }
  EXPECT_FALSE(Read(bytes + '\0').ok());
}

TEST(VocabularyFile, EveryChangedBitIsNoticed) {
  std::string bytes = FileOf(SmallVocabulary());
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
    ASSERT_FALSE(Read(bytes).ok()) << bit;
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
  }
  EXPECT_TRUE(Read(bytes).ok());
}

TEST(VocabularyFile, MessagesSayWhatIsWrong) {
  const Sections good = SectionsOf(FileOf(SmallVocabulary()));
  ASSERT_EQ(good.size(), 4u);
  const auto message = [&](std::size_t number_in_head, std::uint32_t value) {
    Sections sections = good;
    for (int i = 0; i < 4; ++i) sections[0].second[4 * number_in_head + i] = static_cast<char>(value >> (8 * i));
    const Result<Vocabulary> read = Read(FileOf(sections));
    EXPECT_EQ(read.code(), StatusCode::kDataLoss);
    return read.status().message();
  };
  EXPECT_THAT(message(0, 64), HasSubstr("descriptors of 64 bytes"));
  EXPECT_THAT(message(1, 2), HasSubstr("unknown kind of descriptors 2"));
  EXPECT_THAT(message(2, 65), HasSubstr("branching 65"));
  EXPECT_THAT(message(3, 9), HasSubstr("depth 9"));
  EXPECT_THAT(message(4, 0), HasSubstr("no nodes"));
  EXPECT_THAT(message(4, 0xffffffffu), HasSubstr("section TREE has 13 bytes, not 4294967295"));
  EXPECT_THAT(message(5, 0xffffffffu), HasSubstr("section WGHT has 36 bytes, not 17179869180"));
  Sections missing = good;
  missing.pop_back();
  EXPECT_THAT(Read(FileOf(missing)).status().message(), HasSubstr("no section CNTR"));
  Sections doubled = good;
  doubled.push_back(good.back());
  EXPECT_THAT(Read(FileOf(doubled)).status().message(), HasSubstr("no section END"));
  EXPECT_EQ(Read("a file of another kind, longer than the header of any").code(), StatusCode::kInvalidArgument);
}

// Seeded damage behind right checksums: refused, or a tree in which every descriptor finds a word.
TEST(VocabularyFile, ForgedFilesAreRefusedOrUsable) {
  const Sections good = SectionsOf(FileOf(SmallVocabulary()));
  const VocabularySample sample = ClusteredSample(9, 20, 1, 1);
  Rng rng(17);
  int num_refused = 0, num_read = 0;
  for (int round = 0; round < 4000; ++round) {
    Sections sections = good;
    for (int edits = 1 + static_cast<int>(rng.UniformInt(4)); edits > 0; --edits) {
      std::string& payload = sections[rng.UniformInt(static_cast<std::uint32_t>(sections.size()))].second;
      if (payload.empty()) continue;
      const std::size_t at = rng.UniformInt(static_cast<std::uint32_t>(payload.size()));
      switch (rng.UniformInt(8)) {
        case 0: payload.insert(at, 1, static_cast<char>(rng.UniformInt(256))); break;
        case 1: payload.erase(at, 1); break;
        default: payload[at] = static_cast<char>(rng.UniformInt(round % 2 == 0 ? 4 : 256)); break;
      }
    }
    const Result<Vocabulary> read = Read(FileOf(sections));
    if (!read.ok()) {
      EXPECT_EQ(read.code(), StatusCode::kDataLoss);
      EXPECT_FALSE(read.status().message().empty());
      ++num_refused;
      continue;
    }
    ++num_read;
    for (std::size_t i = 0; i < sample.num_descriptors(); ++i) {
      const std::int32_t word = read->WordOf(&sample.descriptors[i * kDescriptorBytes]);
      ASSERT_GE(word, 0);
      ASSERT_LT(word, read->num_words());
      ASSERT_LE(read->weight(word), Vocabulary::kMaxWeight);
    }
  }
  EXPECT_GT(num_refused, 100);
  EXPECT_GT(num_read, 100);
}

}  // namespace
}  // namespace haustra::test
