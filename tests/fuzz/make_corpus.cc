// Writes the corpus of the fuzzers: fuzz_make_corpus FOLDER (tests/fuzz/corpus).
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "engine/depth/depth_file.h"
#include "engine/place/vocabulary_file.h"
#include "tests/engine/io/small_atlas.h"
#include "tests/engine/place/synthetic_words.h"

namespace {

void WriteDepth(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  constexpr haustra::DepthGrid kGrid{4, 5, 3};
  haustra::DepthMap depth(kGrid.width, kGrid.height);
  depth.Clear(0.25);
  for (int i = 0; i < depth.num_cells(); i += 2) depth.Set(i, 1.0 / (0.5 + 0.1 * i), 100 + i);
  const std::vector<std::uint8_t> bgr(3 * static_cast<std::size_t>(depth.num_cells()), 90);
  haustra::StringSink sink;
  haustra::DepthFileWriter writer(sink);
  HAUSTRA_CHECK(writer.Begin(kGrid, 2).ok() && writer.Add(3, 30, depth, bgr).ok() &&
                writer.Add(8, 80, depth, bgr).ok() && writer.End().ok());
  std::ofstream(folder / "two_keyframes_v1.bin", std::ios::binary) << sink.bytes();
}

void WriteVocabularyOf(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  haustra::VocabularyOptions options;
  options.branching = 2;
  options.depth = 2;
  haustra::StringSink sink;
  const auto sample = haustra::test::ClusteredSample(1, 4, 3, 4);
  HAUSTRA_CHECK(haustra::WriteVocabulary(haustra::Vocabulary::Train(sample, options).value(), sink).ok());
  std::ofstream(folder / "small_v1.voc", std::ios::binary) << sink.bytes();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "fuzz_make_corpus FOLDER\n");
    return 64;
  }
  const std::filesystem::path folder = std::filesystem::path(argv[1]) / "atlas";
  std::filesystem::create_directories(folder);
  haustra::test::AtlasHome home;
  const std::string empty = home.Save();
  home.FillSmall();
  const std::string small = home.Save();
  haustra::test::AtlasHome marked;
  marked.FillMarked();
  std::ofstream(folder / "marked_v1.atlas", std::ios::binary) << marked.Save();
  std::ofstream(folder / "empty_v1.atlas", std::ios::binary) << empty;
  std::ofstream(folder / "small_v1.atlas", std::ios::binary) << small;
  WriteDepth(std::filesystem::path(argv[1]) / "depth_file");
  WriteVocabularyOf(std::filesystem::path(argv[1]) / "vocabulary");
  return 0;
}
