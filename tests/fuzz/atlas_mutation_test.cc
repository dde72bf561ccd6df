// The atlas reader against thousands of damaged files: seeded, so that a failure can be repeated. HAUSTRA_FUZZ_RUNS in
// the environment sets their number.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "engine/geometry/rng.h"
#include "tests/engine/io/sealed_file.h"
#include "tests/engine/io/small_atlas.h"
#include "tests/fuzz/atlas_reader_fuzz.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {
namespace {

std::vector<std::uint8_t> CorpusFile(const std::string& name) {
  std::ifstream file(std::string(HAUSTRA_CORPUS) + "/atlas/" + name, std::ios::binary);
  EXPECT_TRUE(file.good()) << name;
  return {std::istreambuf_iterator<char>(file), {}};
}

int NumRuns() {
  const char* text = std::getenv("HAUSTRA_FUZZ_RUNS");
  return text != nullptr ? std::atoi(text) : Trials(2000);
}

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : rng_(seed) {}

  std::size_t Pick(std::size_t size) { return static_cast<std::size_t>(rng_.Uniform() * static_cast<double>(size)); }

  void Mutate(std::vector<std::uint8_t>* file) {
    const std::size_t at = Pick(file->size());
    const auto position = file->begin() + static_cast<std::ptrdiff_t>(at);
    const std::size_t length = std::min(file->size() - at, 1 + Pick(200));
    switch (Pick(6)) {
      case 0: (*file)[at] ^= static_cast<std::uint8_t>(1u << Pick(8)); break;
      case 1: (*file)[at] = static_cast<std::uint8_t>(Pick(256)); break;
      case 2: {
        // Numbers that parsers stumble over; 0x7ff80000 is the upper half of a NaN.
        constexpr std::uint32_t kWords[] = {0,           1,           2,           0xffffffffu, 0x80000000u,
                                            0x7fffffffu, 0x7ff80000u, 0x7fc00000u, 41};
        const std::uint32_t word = kWords[Pick(std::size(kWords))];
        for (std::size_t i = 0; i < 4 && at + i < file->size(); ++i) {
          (*file)[at + i] = static_cast<std::uint8_t>(word >> (8 * i));
        }
        break;
      }
      case 3: file->erase(position, position + static_cast<std::ptrdiff_t>(length)); break;
      case 4: {
        const std::vector<std::uint8_t> part(position, position + static_cast<std::ptrdiff_t>(length));
        file->insert(position, part.begin(), part.end());
        break;
      }
      default: {
        // Fields of one kind change places.
        const std::size_t other = Pick(file->size());
        for (std::size_t i = 0; i < 4 && at + i < file->size() && other + i < file->size(); ++i) {
          std::swap((*file)[at + i], (*file)[other + i]);
        }
      }
    }
  }

 private:
  Rng rng_;
};

class AtlasReaderFuzz : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Corpus, AtlasReaderFuzz, testing::Values("small_v1.atlas", "marked_v1.atlas"));

TEST_P(AtlasReaderFuzz, DamagedFilesAreRefusedAndNothingElseHappens) {
  const std::vector<std::uint8_t> file = CorpusFile(GetParam());
  ASSERT_TRUE(TryAtlasFile(file));
  Mutator mutator(7);
  int num_taken = 0, num_sealed_taken = 0;
  const int num_runs = NumRuns();
  for (int run = 0; run < num_runs; ++run) {
    std::vector<std::uint8_t> damaged = file;
    for (std::size_t i = 0; i < 1 + mutator.Pick(3) && !damaged.empty(); ++i) mutator.Mutate(&damaged);
    num_taken += damaged != file && TryAtlasFile(damaged);
    SealFile(damaged);
    num_sealed_taken += TryAtlasFile(damaged);
  }
  EXPECT_EQ(num_taken, 0);
  // With right checksums a changed descriptor or position is an atlas like any other: both answers must come up, or the
  // test looks at nothing.
  EXPECT_GT(num_sealed_taken, num_runs / 20);
  EXPECT_LT(num_sealed_taken, num_runs * 19 / 20);
}

TEST(AtlasReaderFuzzBytes, AnyBytesAreRefused) {
  Mutator mutator(8);
  for (int run = 0; run < NumRuns() / 10; ++run) {
    std::vector<std::uint8_t> bytes(mutator.Pick(600));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(mutator.Pick(256));
    EXPECT_FALSE(TryAtlasFile(bytes));
    FuzzAtlasReader(bytes);
  }
}

// Files of version 1 are read as long as there are programs that read version 1.
TEST_P(AtlasReaderFuzz, FileOfVersion1IsReadAndSavedAsItIs) {
  const std::vector<std::uint8_t> file = CorpusFile(GetParam());
  AtlasHome home;
  const Status status = home.Load(file);
  ASSERT_TRUE(status.ok()) << status.ToString();
  EXPECT_EQ(BytesOf(home.Save()), file);
  EXPECT_EQ(home.atlas.keyframes().size(), 5u);
  EXPECT_EQ(home.atlas.points().size(), 5u);
}

}  // namespace
}  // namespace haustra::test
