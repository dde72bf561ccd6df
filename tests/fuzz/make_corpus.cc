// Writes what made_corpus.h has: fuzz_make_corpus FOLDER (tests/fuzz/corpus).
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/fuzz/made_corpus.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "fuzz_make_corpus FOLDER\n");
    return 64;
  }
  for (const auto& [name, bytes] : haustra::test::MadeCorpus()) {
    const std::filesystem::path path = std::filesystem::path(argv[1]) / name;
    std::filesystem::create_directories(path.parent_path());
    if (!(std::ofstream(path, std::ios::binary) << bytes).flush()) {
      std::fprintf(stderr, "%s: cannot be written\n", path.c_str());
      return 74;
    }
  }
  return 0;
}
