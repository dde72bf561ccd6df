// What a procedure leaves behind in the GPU's memory when its worker has gone, and how long the next one takes to stand
// ready. Runs where there is a CUDA device that nobody else uses.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <bitset>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "capture/codec/image_codec.h"
#include "tests/end_to_end/result_files.h"
#include "tests/end_to_end/service_process.h"
#include "tests/kernels/cuda_device_present.h"
#include "tests/kernels/cuda_memory_search.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

// Words that are hardly anywhere by chance, as many of each phase: what is searched stands at multiples of four bytes
// on the device, wherever it stood in `bytes`.
std::vector<std::uint64_t> TellingWords(const std::string& bytes, std::size_t num_words) {
  constexpr std::size_t kPhases = 4;
  constexpr std::size_t kWord = sizeof(std::uint64_t);
  std::mt19937 random(3);
  std::vector<std::uint64_t> words;
  for (int i = 0; i < 1'000'000 && words.size() < num_words; ++i) {
    const std::size_t at = random() % (bytes.size() / kPhases - kWord) * kPhases + words.size() % kPhases;
    std::bitset<256> values;
    for (std::size_t k = 0; k < kWord; ++k) values.set(static_cast<unsigned char>(bytes[at + k]));
    if (values.count() < kWord - 1) continue;
    std::memcpy(&words.emplace_back(), bytes.data() + at, kWord);
  }
  return words;
}

std::string PixelsOf(const std::string& sequence) {
  std::string pixels;
  for (const auto& file : fs::directory_iterator(sequence + "/frames")) {
    const Result<Image> image = ReadImage(file.path(), ChannelChoice::kAsStored);
    EXPECT_TRUE(image.ok()) << image.status().ToString();
    if (!image.ok()) break;
    const ImageView view = image->view();
    for (int y = 0; y < view.height; ++y) {
      pixels.append(reinterpret_cast<const char*>(view.row(y)),
                    static_cast<std::size_t>(view.width) * BytesPerPixel(view.format));
    }
  }
  return pixels;
}

std::uint64_t NumFoundOnTheGpu(const std::vector<std::uint64_t>& words) {
  const Result<testing::FreeMemorySearch> search = testing::SearchFreeDeviceMemory(words);
  EXPECT_TRUE(search.ok()) << search.status().ToString();
  if (!search.ok()) return 0;
  EXPECT_GT(search->num_searched_bytes, std::uint64_t{1} << 28);
  return search->num_found;
}

class DaemonGpu : public ::testing::Test {
 protected:
  DaemonGpu() : service_(ScratchFolder()) {}

  void SetUp() override {
    if (!testing::IsCudaDevicePresent()) GTEST_SKIP() << testing::NoCudaDeviceReason();
  }
  void StartReady() {
    service_.Start({"--source", SequenceFolder("standard"), "--set", "vision.device=cuda", "--set",
                    std::string("source.rate=") + HAUSTRA_END_TO_END_RATE});
    ASSERT_TRUE(service_.WaitForMessage("READY=1")) << service_.Wait().ToString();
  }
  void BeginAndMap(const std::string& label) {
    ASSERT_TRUE(service_.Ask("begin " + label).starts_with("procedure ")) << label;
    ASSERT_TRUE(service_.WaitForStatus("tracking tracking"));
    ASSERT_TRUE(service_.WaitForStatus("maps 1"));
  }
  void Stop() {
    service_.command().Signal(SIGTERM);
    EXPECT_EQ(service_.Wait().exit_code, 0);
  }

  ServiceProcess service_;
};

// Nobody clears anything when a worker is killed but the driver.
TEST_F(DaemonGpu, NothingOfAProcedureIsLeftInItsMemory) {
  RecordProperty("req", "DATA-001");
  std::mt19937 random(1);
  std::vector<std::uint64_t> control(testing::kMaxSearchedWords);
  for (std::uint64_t& word : control) word = std::uint64_t{random()} << 32 | random();
  ASSERT_TRUE(testing::LeaveInDeviceMemory(control).ok());
  const bool can_find = NumFoundOnTheGpu(control) > 0;

  ASSERT_NO_FATAL_FAILURE(StartReady());
  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-1"));
  ASSERT_TRUE(service_.Ask("save sample").starts_with("saved "));
  const std::string maps = ReadBytes(service_.state_folder() + "/saved/sample.atlas");
  ASSERT_EQ(service_.Ask("end wipe"), "wiped\n");
  const std::vector<std::uint64_t> of_maps = TellingWords(maps, testing::kMaxSearchedWords);
  const std::vector<std::uint64_t> of_pictures =
      TellingWords(PixelsOf(SequenceFolder("standard")), testing::kMaxSearchedWords);
  ASSERT_EQ(of_maps.size(), testing::kMaxSearchedWords);
  ASSERT_GE(of_pictures.size(), 16u);
  EXPECT_EQ(NumFoundOnTheGpu(of_maps), 0u) << "of the maps, after end";
  EXPECT_EQ(NumFoundOnTheGpu(of_pictures), 0u) << "of the pictures, after end";

  ASSERT_NO_FATAL_FAILURE(BeginAndMap("case-2"));
  const std::string worker = service_.StatusValue("worker");
  ASSERT_EQ(::kill(std::stoi(worker), SIGKILL), 0);
  ASSERT_TRUE(service_.WaitForStatus("worker_faults 1"));
  ASSERT_EQ(service_.Ask("end wipe"), "wiped\n");
  EXPECT_EQ(NumFoundOnTheGpu(of_maps), 0u) << "of the maps, after kill -9";
  EXPECT_EQ(NumFoundOnTheGpu(of_pictures), 0u) << "of the pictures, after kill -9";
  Stop();
  if (!can_find) GTEST_SKIP() << "this driver clears what is given back: nothing can be found";
}

// Written down, not judged: `end` is answered when the next worker stands ready, its CUDA context and pools included.
TEST_F(DaemonGpu, TimeFromTheEndToTheNextReadyWorkerIsWrittenDown) {
  RecordProperty("req", "DMN-004");
  constexpr int kNumProcedures = 10;
  const auto milliseconds_since = [](steady_clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(steady_clock::now() - begin).count();
  };
  const steady_clock::time_point started = steady_clock::now();
  ASSERT_NO_FATAL_FAILURE(StartReady());
  const double first_ms = milliseconds_since(started);
  std::vector<double> begins_ms, ends_ms;
  for (int i = 0; i < kNumProcedures; ++i) {
    const steady_clock::time_point begin = steady_clock::now();
    ASSERT_TRUE(service_.Ask("begin").starts_with("procedure "));
    begins_ms.push_back(milliseconds_since(begin));
    ASSERT_TRUE(service_.WaitForStatus("maps 1"));
    const steady_clock::time_point end = steady_clock::now();
    ASSERT_EQ(service_.Ask("end wipe"), "wiped\n");
    ends_ms.push_back(milliseconds_since(end));
    EXPECT_EQ(service_.StatusValue("state"), "idle");
  }
  Stop();
  std::sort(begins_ms.begin(), begins_ms.end());
  std::sort(ends_ms.begin(), ends_ms.end());
  std::printf(
      "start to ready %.0f ms; begin: median %.1f ms, worst %.1f ms; end to ready: median %.0f ms, worst %.0f ms\n",
      first_ms, begins_ms[kNumProcedures / 2], begins_ms.back(), ends_ms[kNumProcedures / 2], ends_ms.back());
}

}  // namespace
}  // namespace haustra::end_to_end
