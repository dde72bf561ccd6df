// Every file of the corpora, whole, cut short and with bytes changed, through the fuzzers' functions: what they found
// once does not come back, and they work where libFuzzer is not at hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "engine/geometry/rng.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/made_corpus.h"

namespace haustra::test {
namespace {

using Entry = void (*)(std::span<const std::uint8_t>);

std::vector<std::vector<std::uint8_t>> Corpus(const std::string& name) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(HAUSTRA_CORPUS) + "/" + name)) {
    paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<std::vector<std::uint8_t>> files;
  for (const auto& path : paths) {
    std::ifstream file(path, std::ios::binary);
    files.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return files;
}

void Replay(const std::string& name, Entry entry, int num_changes) {
  const auto files = Corpus(name);
  ASSERT_FALSE(files.empty()) << name;
  Rng rng(5);
  const auto pick = [&](std::size_t size) {
    return static_cast<std::size_t>(rng.Uniform() * static_cast<double>(size));
  };
  for (const auto& file : files) {
    entry(file);
    if (file.empty()) continue;
    for (int i = 0; i < num_changes; ++i) {
      std::vector<std::uint8_t> changed = file;
      for (std::size_t k = 0; k <= pick(3); ++k) changed[pick(changed.size())] = static_cast<std::uint8_t>(pick(256));
      if (i % 4 == 0) changed.resize(pick(changed.size()));
      entry(changed);
    }
  }
}

// On another architecture the last digits of sines and weights may be others.
TEST(Corpus, IsWhatTheWritersMakeOfIt) {
#ifndef __x86_64__
  GTEST_SKIP() << "the corpus was made on x86-64";
#endif
  for (const auto& [name, made] : MadeCorpus()) {
    std::ifstream file(std::string(HAUSTRA_CORPUS) + "/" + name, std::ios::binary);
    EXPECT_TRUE(std::string(std::istreambuf_iterator<char>(file), {}) == made) << name << ": see fuzz_make_corpus";
  }
}

TEST(Corpus, Config) { Replay("config", FuzzConfig, 40); }
TEST(Corpus, Calibration) { Replay("calibration", FuzzCalibration, 200); }
TEST(Corpus, Trajectory) { Replay("trajectory", FuzzTrajectory, 200); }
TEST(Corpus, Image) { Replay("image", FuzzImage, 200); }
TEST(Corpus, Video) { Replay("video", FuzzVideo, 20); }
TEST(Corpus, DepthFile) { Replay("depth_file", FuzzDepthFile, 500); }
TEST(Corpus, Vocabulary) { Replay("vocabulary", FuzzVocabulary, 500); }
TEST(Corpus, Table) { Replay("table", FuzzTable, 200); }
TEST(Corpus, RangePicture) { Replay("range_picture", FuzzRangePicture, 200); }
TEST(Corpus, EventScript) { Replay("event_script", FuzzEventScript, 500); }
TEST(Corpus, CameraSpec) { Replay("camera_spec", FuzzCameraSpec, 500); }
TEST(Corpus, CpuList) { Replay("cpu_list", FuzzCpuList, 500); }
TEST(Corpus, Colmap) { Replay("colmap", FuzzColmap, 300); }
TEST(Corpus, RunOutput) { Replay("run_output", FuzzRunOutput, 300); }
TEST(Corpus, RequestGate) { Replay("request_gate", FuzzRequestGate, 500); }

}  // namespace
}  // namespace haustra::test
