// Writes the corpus of the fuzzers: fuzz_make_corpus FOLDER (tests/fuzz/corpus).
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/engine/io/small_atlas.h"

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
  return 0;
}
