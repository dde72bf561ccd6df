// A run that is told to stop, or whose sequence goes away, writes what was mapped until then. A frame that is a named
// pipe holds the run at exactly that frame while the test does its deed; no time is guessed.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"
#include "tools/exit_codes.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

constexpr int kNumFrames = 200;
constexpr int kHeldFrame = 100;

// A run that stands still, waiting for the pixels of kHeldFrame.
class HeldRun : public testing::Test {
 protected:
  void Start(const std::vector<std::string>& more_arguments) {
    const std::string scratch = ScratchFolder();
    sequence_ = scratch + "/sequence";
    out_ = scratch + "/out";
    CopySequence(SequenceFolder("standard"), sequence_, kNumFrames);
    const std::string frame = FramePath(sequence_, kHeldFrame);
    held_bytes_ = ReadBytes(frame);

    if (has_earlier_results_) {
      WriteBytes(out_ + "/frames.csv", "earlier");
      WriteBytes(out_ + "/trajectory/live.tum", "earlier");
    }
    std::vector<std::string> arguments = {"run", sequence_, "--out", out_, "--device", "cpu"};
    arguments.insert(arguments.end(), more_arguments.begin(), more_arguments.end());
    command_ = std::make_unique<Command>(HaustraCommand(arguments));
    // The output folder is made when the files of the sequence have been listed.
    while (command_->IsRunning() && !Exists(out_ + "/maps")) Pause();
    const std::string pipe = scratch + "/pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    fs::rename(pipe, frame);
    while (pipe_ < 0 && command_->IsRunning()) {
      pipe_ = open(frame.c_str(), O_WRONLY | O_NONBLOCK);
      Pause();
    }
    ASSERT_GE(pipe_, 0) << "the run ended before frame " << kHeldFrame << ": " << command_->Wait(kHangLimit).ToString();
  }
  void TearDown() override {
    if (pipe_ >= 0) close(pipe_);
  }

  // Gives the frame; a later reading finds an ordinary file.
  CommandResult LetGo() {
    WriteBytes(FramePath(sequence_, kHeldFrame), held_bytes_);
    EXPECT_EQ(write(pipe_, held_bytes_.data(), held_bytes_.size()), static_cast<ssize_t>(held_bytes_.size()));
    close(pipe_);
    pipe_ = -1;
    return command_->Wait(kHangLimit);
  }

  // Everything is there, for the frames up to the held one, and it holds a map.
  void ExpectResultsUpToTheHeldFrame(int num_more = 0) {
    CsvRows frames = ReadCsv(out_ + "/frames.csv");
    const int num_frames = static_cast<int>(frames.size());
    ASSERT_GE(num_frames, kHeldFrame + 1);
    ASSERT_LE(num_frames, kHeldFrame + 1 + num_more);
    const nlohmann::json summary = ReadJson(out_ + "/summary.json");
    EXPECT_EQ(summary.at("frames").get<int>(), num_frames);
    EXPECT_EQ(summary.at("sequence_frames").get<int>(), kNumFrames);
    EXPECT_NEAR(summary.at("coverage").get<double>(), 100.0 * summary.at("localised").get<int>() / kNumFrames, 1e-9);
    for (const char* name : {"maps.csv", "events.csv", "trajectory/live.tum"}) EXPECT_TRUE(Exists(out_ + "/" + name));
  }
  void ExpectAMap() {
    EXPECT_GE(ReadJson(out_ + "/summary.json").at("localised").get<int>(), kHeldFrame / 2);
    EXPECT_TRUE(Exists(out_ + "/trajectory/map_0000.tum"));
    EXPECT_TRUE(Exists(out_ + "/maps/map_0000.ply"));
    EXPECT_TRUE(Exists(out_ + "/maps/map_0000/points3D.txt"));
  }

  std::string sequence_, out_;
  bool has_earlier_results_ = false;
  std::unique_ptr<Command> command_;

 private:
  static void Pause() { std::this_thread::sleep_for(std::chrono::milliseconds(2)); }

  std::string held_bytes_;
  int pipe_ = -1;
};

TEST_F(HeldRun, TerminateSignalEndsASequentialRunWithItsResults) {
  ASSERT_NO_FATAL_FAILURE(Start({}));
  command_->Signal(SIGTERM);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
  ExpectAMap();
}

TEST_F(HeldRun, InterruptSignalEndsARealTimeRunWithItsResults) {
  ASSERT_NO_FATAL_FAILURE(Start({"--mode", "realtime", "--rate", "2"}));
  command_->Signal(SIGINT);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  // On a thread of its own, reading may have begun with the next frame before it saw the signal.
  ExpectResultsUpToTheHeldFrame(1);
}

TEST_F(HeldRun, SequenceThatGoesAwayLeavesTheResultsUntilThen) {
  ASSERT_NO_FATAL_FAILURE(Start({}));
  fs::remove(sequence_ + "/calib.yaml");
  command_->Signal(SIGTERM);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  EXPECT_NE(result.err.find("calib.yaml"), std::string::npos) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
  ExpectAMap();
}

TEST_F(HeldRun, KilledRunLeavesTheEarlierResults) {
  has_earlier_results_ = true;
  ASSERT_NO_FATAL_FAILURE(Start({"--overwrite"}));
  command_->Signal(SIGKILL);
  command_->Wait(kHangLimit);
  const std::string aside = out_ + "/replaced-" + std::to_string(command_->pid());
  EXPECT_EQ(ReadBytes(aside + "/frames.csv"), "earlier");
  EXPECT_EQ(ReadBytes(aside + "/trajectory/live.tum"), "earlier");
  // And nothing replaces them by accident.
  const CommandResult again = HaustraOnCpu({"run", SequenceFolder("standard"), "--out", out_});
  EXPECT_EQ(again.exit_code, kExitInTheWay) << again.ToString();
}

TEST_F(HeldRun, ReportThatCannotBeWrittenLeavesAGoodRunAndIsSaid) {
  ASSERT_NO_FATAL_FAILURE(Start({}));
  fs::create_directories(out_ + "/report.html/in_the_way");
  command_->Signal(SIGTERM);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  EXPECT_NE(result.err.find("warning: there is no report"), std::string::npos) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
}

}  // namespace
}  // namespace haustra::end_to_end
