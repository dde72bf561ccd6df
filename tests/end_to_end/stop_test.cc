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

constexpr int kNumFrames = 80;
constexpr int kHeldFrame = 40;

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
    arguments = HaustraCommand(arguments);
    if (!has_reader_) {
      // The reader has gone when the program starts; `exec` keeps the process that the test signals.
      arguments.insert(arguments.begin(), {"/bin/bash", "-c", "exec \"$@\" > >(:) 2>&1", "bash"});
    }
    command_ = std::make_unique<Command>(arguments);
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
  bool has_reader_ = true;
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
  EXPECT_NE(result.err.find("stopped after 41 frames"), std::string::npos) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
  ExpectAMap();
}

TEST_F(HeldRun, TerminalThatIsClosedEndsARunWithItsResults) {
  ASSERT_NO_FATAL_FAILURE(Start({}));
  command_->Signal(SIGHUP);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
}

// As under nohup.
TEST_F(HeldRun, TerminalThatIsClosedIsNothingToARunThatIgnoresIt) {
  signal(SIGHUP, SIG_IGN);
  Start({});
  signal(SIGHUP, SIG_DFL);
  if (HasFatalFailure()) return;
  command_->Signal(SIGHUP);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  EXPECT_EQ(ReadCsv(out_ + "/frames.csv").size(), static_cast<std::size_t>(kNumFrames));
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

// With a part of its answer said before: what reads it has seen enough.
TEST_F(HeldRun, ReaderOfTheOutputThatGoesAwayCostsNothing) {
  has_reader_ = false;
  ASSERT_NO_FATAL_FAILURE(Start({}));
  command_->Signal(SIGTERM);
  const CommandResult result = LetGo();
  EXPECT_EQ(result.exit_code, 0) << result.ToString();
  ExpectResultsUpToTheHeldFrame();
  EXPECT_TRUE(Exists(out_ + "/report.html"));
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

// Commands that wait for a named pipe as one of their inputs, and are told to stop.
class StoppedCommand : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(StoppedCommand, SaysSoAndLeavesNothing) {
  const std::string scratch = ScratchFolder();
  const std::string run = scratch + "/run", pipe = run + "/frames.csv";
  fs::create_directories(run);
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const std::vector<std::string> outputs = {scratch + "/out.file", scratch + "/out"};
  std::vector<std::string> arguments;
  for (const std::string& argument : GetParam()) {
    arguments.push_back(argument == "RUN"        ? run
                        : argument == "PIPE"     ? pipe
                        : argument == "SEQUENCE" ? SequenceFolder("standard")
                        : argument == "FILE"     ? outputs[0]
                        : argument == "OUT"      ? outputs[1]
                                                 : argument);
  }
  Command command(HaustraCommand(arguments));
  int held = -1;
  while (held < 0 && command.IsRunning()) {
    held = open(pipe.c_str(), O_WRONLY | O_NONBLOCK);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  command.Signal(SIGINT);
  const CommandResult result = command.Wait(kHangLimit);
  ASSERT_GE(held, 0) << result.ToString();
  close(held);
  EXPECT_EQ(result.exit_code, kExitStopped) << result.ToString();
  EXPECT_EQ(result.err, "haustra " + GetParam().front() + ": stopped\n");
  for (const std::string& output : outputs) EXPECT_FALSE(Exists(output)) << output;
}

INSTANTIATE_TEST_SUITE_P(Commands, StoppedCommand,
                         testing::Values(std::vector<std::string>{"evaluate", "RUN", "--json", "FILE"},
                                         std::vector<std::string>{"report", "RUN", "--html", "FILE"},
                                         std::vector<std::string>{"calibrate", "SEQUENCE", "--mask", "PIPE", "--out",
                                                                  "FILE"},
                                         std::vector<std::string>{"export", "RUN", "--format", "tum", "--out", "OUT"},
                                         std::vector<std::string>{"surface", "RUN", "--out", "OUT"}),
                         [](const auto& commands) { return commands.param.front(); });

// What has no end of its own.
class StoppedOnlooker : public testing::TestWithParam<const char*> {};

TEST_P(StoppedOnlooker, SaysSo) {
  const std::string scratch = ScratchFolder(), said = scratch + "/said";
  std::vector<std::string> arguments = HaustraCommand({GetParam(), "--folder", scratch});
  arguments.insert(arguments.begin(), {"/bin/bash", "-c", "exec \"$@\" > " + said, "bash"});
  Command command(arguments);
  while (command.IsRunning() && (!Exists(said) || ReadBytes(said).empty())) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  command.Signal(SIGINT);
  const CommandResult result = command.Wait(kHangLimit);
  EXPECT_EQ(result.exit_code, kExitStopped) << result.ToString();
  EXPECT_TRUE(result.err.ends_with("haustra " + std::string(GetParam()) + ": stopped\n")) << result.ToString();
}

INSTANTIATE_TEST_SUITE_P(Commands, StoppedOnlooker, testing::Values("view", "watch"),
                         [](const auto& commands) { return std::string(commands.param); });

// One that writes from its start on.
TEST(StoppedRender, PutsTheEarlierSequenceBack) {
  const std::string out = ScratchFolder() + "/out";
  ASSERT_EQ(Haustra({"render", out, "--seconds", "0.2", "--size", "64x64", "--events", "none"}).exit_code, 0);
  const std::string times = ReadBytes(out + "/times.txt");
  Command command(HaustraCommand({"render", out, "--seconds", "600", "--size", "360x270", "--overwrite"}));
  // Five frames were there before.
  while (command.IsRunning() && !Exists(FramePath(out, 6))) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  command.Signal(SIGINT);
  const CommandResult result = command.Wait(kHangLimit);
  EXPECT_EQ(result.exit_code, kExitStopped) << result.ToString();
  EXPECT_NE(result.err.find("haustra render: stopped at frame "), std::string::npos) << result.ToString();
  EXPECT_EQ(ReadBytes(out + "/times.txt"), times);
  EXPECT_TRUE(Exists(FramePath(out, 4)));
  EXPECT_FALSE(Exists(FramePath(out, 5)));
  EXPECT_FALSE(Exists(out + "/replaced-" + std::to_string(command.pid())));
}

TEST(StoppedLatency, SaysAfterHowLongAndWritesWhatWasMeasured) {
  const std::string out = ScratchFolder() + "/out";
  Command command(HaustraCommand({"latency", SequenceFolder("standard"), "--rate", HAUSTRA_END_TO_END_RATE, "--seconds",
                                  "600", "--warm-up", "0", "--loop", "1", "--out", out, "--device", "cpu"}));
  while (command.IsRunning() && !Exists(out)) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  std::this_thread::sleep_for(std::chrono::seconds(3));
  command.Signal(SIGTERM);
  const CommandResult result = command.Wait(kHangLimit);
  EXPECT_EQ(result.exit_code, kExitStopped) << result.ToString();
  EXPECT_NE(result.err.find("haustra latency: stopped after "), std::string::npos) << result.ToString();
  EXPECT_NE(ReadBytes(out + "/latency.json").find("of 600.0 s"), std::string::npos);
}

TEST(StoppedLatency, WhileItWarmsUpHasMeasuredNothing) {
  const std::string scratch = ScratchFolder(), out = scratch + "/out", requirement = scratch + "/requirement.yaml";
  WriteBytes(out + "/latency.json", "earlier");
  WriteBytes(requirement, "max_ms: 100000\nmisses: 0\n");
  Command command(HaustraCommand({"latency", SequenceFolder("standard"), "--rate", HAUSTRA_END_TO_END_RATE, "--seconds",
                                  "600", "--warm-up", "500", "--loop", "1", "--out", out, "--overwrite", "--require",
                                  requirement, "--device", "cpu"}));
  // The last thing before it measures.
  const std::string aside = out + "/replaced-" + std::to_string(command.pid());
  while (command.IsRunning() && !Exists(aside)) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  command.Signal(SIGTERM);
  const CommandResult result = command.Wait(kHangLimit);
  EXPECT_EQ(result.exit_code, kExitStopped) << result.ToString();
  EXPECT_EQ(result.out.find("REQUIREMENT MET"), std::string::npos) << result.ToString();
  EXPECT_EQ(ReadBytes(out + "/latency.json"), "earlier");
  EXPECT_FALSE(Exists(aside));
}

}  // namespace
}  // namespace haustra::end_to_end
