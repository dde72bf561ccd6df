// Sequential mode repeats to the byte, on any number of threads. The sequence has losses, relocalisations and a merge,
// so every part of the engine takes part.
#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

// What is measured and not computed.
nlohmann::json WithoutTimes(nlohmann::json summary) {
  for (const char* key : {"frame_ms", "peak_rss_mb", "wall_s", "realtime_ratio", "tracking_thread"}) {
    summary.erase(key);
  }
  summary.at("mapping").erase("mean_ms");
  return summary;
}

void ExpectSameFiles(const std::string& folder_a, const std::string& folder_b) {
  const std::vector<std::string> files = FilesBelow(folder_a);
  ASSERT_EQ(FilesBelow(folder_b), files);
  ASSERT_GT(files.size(), 8u);
  for (const std::string& file : files) {
    if (file == "summary.json" || file == "times.csv" || file == "report.html") continue;
    EXPECT_TRUE(ReadBytes(folder_a + "/" + file) == ReadBytes(folder_b + "/" + file)) << file << " differs";
  }
  EXPECT_EQ(WithoutTimes(ReadJson(folder_a + "/summary.json")), WithoutTimes(ReadJson(folder_b + "/summary.json")));
}

void ExpectRunLikeTheFirst(const std::string& sequence, const std::vector<std::string>& more_arguments) {
  const std::string out = ScratchFolder() + "/out";
  std::vector<std::string> arguments = {"run", SequenceFolder(sequence), "--out", out, "--device", "cpu"};
  arguments.insert(arguments.end(), more_arguments.begin(), more_arguments.end());
  const CommandResult result = Haustra(arguments);
  ASSERT_EQ(result.exit_code, 0) << result.ToString();
  ExpectSameFiles(ResultFolder(sequence), out);
}

TEST(Determinism, SameCommandGivesSameFiles) { ExpectRunLikeTheFirst("standard", {}); }

TEST(Determinism, OtherNumberOfThreadsGivesSameFiles) {
  const std::size_t num_cores = std::thread::hardware_concurrency();
  ExpectRunLikeTheFirst("losses", {"--threads", num_cores == 1 ? "3" : "1"});
}

}  // namespace
}  // namespace haustra::end_to_end
