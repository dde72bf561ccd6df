// What a user gets wrong, and what disks and cables do: always a message that names the thing and the documented exit
// code (tools/exit_codes.h), never a crash, and nothing of the user's is lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"
#include "tools/exit_codes.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::string> ContentOf(const std::string& folder) {
  std::map<std::string, std::string> content;
  for (const std::string& file : FilesBelow(folder)) content[file] = ReadBytes(folder + "/" + file);
  return content;
}

void ExpectOutcome(const CommandResult& result, int exit_code, const std::vector<std::string>& words) {
  EXPECT_EQ(result.exit_code, exit_code) << result.ToString();
  const std::string said = result.out + result.err;
  for (const std::string& word : words) {
    EXPECT_NE(said.find(word), std::string::npos) << "no '" << word << "' in: " << result.ToString();
  }
}

// The commands started from here on see none, whatever the machine has.
void HideCudaDevices() { setenv("CUDA_VISIBLE_DEVICES", "", 1); }

// A short sequence that the test spoils, and a place for the results.
class BadInput : public testing::Test {
 protected:
  void SetUp() override {
    scratch_ = ScratchFolder();
    sequence_ = scratch_ + "/sequence";
    out_ = scratch_ + "/out";
    CopySequence(SequenceFolder("standard"), sequence_, 3);
  }

  CommandResult Run(const std::vector<std::string>& more_arguments = {}) const {
    std::vector<std::string> arguments = {"run", sequence_, "--out", out_};
    if (std::find(more_arguments.begin(), more_arguments.end(), "--device") == more_arguments.end()) {
      arguments.insert(arguments.end(), {"--device", "cpu"});
    }
    arguments.insert(arguments.end(), more_arguments.begin(), more_arguments.end());
    return Haustra(arguments);
  }
  // The run refuses to start: nothing is made.
  void ExpectRefusal(int exit_code, const std::vector<std::string>& words,
                     const std::vector<std::string>& more_arguments = {}) const {
    ExpectOutcome(Run(more_arguments), exit_code, words);
    EXPECT_FALSE(Exists(out_));
  }
  std::string Write(const std::string& name, const std::string& text) const {
    WriteBytes(scratch_ + "/" + name, text);
    return scratch_ + "/" + name;
  }
  void SpoilTimes(const std::string& second) const { ReplaceInFile(sequence_ + "/times.txt", "0.040000", second); }
  void SpoilCalibration(const std::string& from, const std::string& to) const {
    ReplaceInFile(sequence_ + "/calib.yaml", from, to);
  }

  std::string scratch_, sequence_, out_;
};

TEST_F(BadInput, MissingFolderIsNamed) {
  fs::remove_all(sequence_);
  ExpectRefusal(kExitNoInput, {sequence_});
}

TEST_F(BadInput, SequenceWithoutImagesIsEmpty) {
  fs::remove_all(sequence_ + "/frames");
  fs::create_directories(sequence_ + "/frames");
  ExpectRefusal(kExitBadData, {sequence_, "empty"});
}

TEST_F(BadInput, FolderOfSomethingElseIsNoSequence) {
  fs::remove_all(sequence_);
  Write("sequence/notes.txt", "nothing to see");
  ExpectRefusal(kExitBadData, {sequence_});
}

// Three frames do not hold a focal length: the run goes on with a guess, and says so.
TEST_F(BadInput, MissingCalibrationIsNamedAndGuessed) {
  fs::remove(sequence_ + "/calib.yaml");
  ExpectOutcome(Run(), 0, {"put a calib.yaml there", "3 frames are too few", "focal length guessed"});
  EXPECT_TRUE(Exists(out_ + "/calib.yaml"));
}

// An estimate that finds no room is no reason to lose the maps.
TEST_F(BadInput, EstimateThatCannotBeWrittenCostsNothingElse) {
  fs::remove(sequence_ + "/calib.yaml");
  std::thread in_the_way([this] {
    // Made at the start of the session, which takes a second then.
    while (!Exists(out_ + "/trajectory")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    fs::create_directory(out_ + "/calib.yaml");
  });
  const std::string atlas = scratch_ + "/maps.atlas";
  const CommandResult run = Run({"--mode", "realtime", "--rate", "0.05", "--save-atlas", atlas});
  in_the_way.join();
  ExpectOutcome(run, kExitIo, {"calib.yaml"});
  EXPECT_TRUE(Exists(atlas));
  EXPECT_TRUE(Exists(out_ + "/summary.json"));
}

TEST_F(BadInput, TypoInCalibrationIsNamed) {
  SpoilCalibration("Camera.k2", "Camera.kk2");
  ExpectRefusal(kExitBadData, {"calib.yaml", "k2"});
}

TEST_F(BadInput, WordForANumberInCalibrationIsNamed) {
  SpoilCalibration("Camera.fx: 197.3", "Camera.fx: wide");
  ExpectRefusal(kExitBadData, {"calib.yaml", "fx", "wide"});
}

TEST_F(BadInput, NanInCalibrationIsNamed) {
  SpoilCalibration("Camera.fx: 197.3", "Camera.fx: nan");
  ExpectRefusal(kExitBadData, {"calib.yaml", "fx", "nan"});
}

TEST_F(BadInput, BrokenYamlInCalibrationIsNamed) {
  SpoilCalibration("Camera.type: \"KannalaBrandt8\"", "Camera.type: \"KannalaBrandt8");
  ExpectRefusal(kExitBadData, {"calib.yaml"});
}

TEST_F(BadInput, UnknownCameraModelIsNamed) {
  SpoilCalibration("KannalaBrandt8", "Fishbowl");
  ExpectRefusal(kExitBadData, {"calib.yaml", "Fishbowl"});
}

TEST_F(BadInput, ImagesOfAnotherSizeThanTheCalibrationAreNamed) {
  SpoilCalibration("Camera.width: 360", "Camera.width: 720");
  ExpectRefusal(kExitBadData, {"000000.jpg", "360x270", "720x270"});
}

TEST_F(BadInput, MaskOfAnotherSizeIsNamed) {
  fs::copy_file(SequenceFolder("other_size") + "/mask.png", sequence_ + "/mask.png",
                fs::copy_options::overwrite_existing);
  ExpectRefusal(kExitBadData, {"mask.png", "240x180", "360x270"});
}

TEST_F(BadInput, DuplicateTimeIsNamedWithItsLine) {
  SpoilTimes("0.000000");
  ExpectRefusal(kExitBadData, {"times.txt:2"});
}

TEST_F(BadInput, BackwardTimeIsNamedWithItsLine) {
  SpoilTimes("0.090000");
  ExpectRefusal(kExitBadData, {"times.txt:3"});
}

TEST_F(BadInput, WordForATimeIsNamedWithItsLine) {
  SpoilTimes("soon");
  ExpectRefusal(kExitBadData, {"times.txt:2", "soon"});
}

TEST_F(BadInput, FewerTimesThanImagesAreCounted) {
  ReplaceInFile(sequence_ + "/times.txt", "0.040000\n", "");
  ExpectRefusal(kExitBadData, {"times.txt", "2", "3"});
}

TEST_F(BadInput, SequenceOfBrokenImagesOnlyIsRefused) {
  for (const int index : {0, 1, 2}) WriteBytes(FramePath(sequence_, index), "no image");
  ExpectRefusal(kExitBadData, {"000000.jpg"});
}

TEST_F(BadInput, UnknownConfigurationKeyIsNamedWithItsLine) {
  const std::string config = Write("config.yaml", "tracking:\n  min_inlier: 20\n");
  ExpectRefusal(kExitConfig, {config + ":2", "min_inlier"}, {"--config", config});
}

TEST_F(BadInput, ConfigurationValueOutOfRangeIsNamedWithTheRange) {
  const std::string config = Write("config.yaml", "features:\n  max: 9\n");
  ExpectRefusal(kExitConfig, {config + ":2", "features.max", "9", "100", "8000"}, {"--config", config});
}

TEST_F(BadInput, ConfigurationThatIsNoYamlIsNamed) {
  const std::string config = Write("config.yaml", "features: [\n");
  ExpectRefusal(kExitConfig, {config}, {"--config", config});
}

TEST_F(BadInput, MissingConfigurationFileIsNamed) {
  ExpectRefusal(kExitConfig, {scratch_ + "/none.yaml"}, {"--config", scratch_ + "/none.yaml"});
}

TEST_F(BadInput, UnknownKeyOnTheCommandLineIsNamed) {
  ExpectRefusal(kExitConfig, {"tracking.speed"}, {"--set", "tracking.speed=3"});
}

TEST_F(BadInput, ValueOnTheCommandLineOutOfRangeIsNamed) {
  ExpectRefusal(kExitConfig, {"noise.k", "-1"}, {"--set", "noise.k=-1"});
}

TEST_F(BadInput, DeviceThatIsNotThereIsUnavailable) {
  HideCudaDevices();
  ExpectRefusal(kExitUnavailable, {"cuda"}, {"--device", "cuda"});
}

TEST_F(BadInput, OutputNameOfAFileIsRefusedAndTheFileKept) {
  Write("out", "precious");
  ExpectOutcome(Run(), kExitInTheWay, {out_});
  EXPECT_EQ(ReadBytes(out_), "precious");
}

TEST_F(BadInput, OutputFolderBelowAFileIsAnIoError) {
  const std::string file = Write("file", "precious");
  out_ = file + "/out";
  ExpectOutcome(Run(), kExitIo, {out_});
  EXPECT_EQ(ReadBytes(file), "precious");
}

TEST_F(BadInput, OutputFolderWithForeignFilesIsRefusedAndKept) {
  Write("out/thesis.tex", "precious");
  Write("out/maps/map_0000.ply", "of somebody's");
  const auto before = ContentOf(out_);
  ExpectOutcome(Run(), kExitInTheWay, {out_, "not part of a run"});
  ExpectOutcome(Run({"--overwrite"}), kExitInTheWay, {out_, "not part of a run"});
  EXPECT_EQ(ContentOf(out_), before);
}

TEST_F(BadInput, SequenceAsItsOwnOutputFolderIsRefusedAndKept) {
  out_ = sequence_;
  const auto before = ContentOf(out_);
  ExpectOutcome(Run({"--overwrite"}), kExitInTheWay, {out_});
  EXPECT_EQ(ContentOf(out_), before);
}

TEST_F(BadInput, ForeignFileDeepInAnEarlierRunIsKept) {
  ASSERT_EQ(Run().exit_code, 0);
  Write("out/maps/scan_of_patient.ply", "precious");
  const auto before = ContentOf(out_);
  ExpectOutcome(Run({"--overwrite"}), kExitInTheWay, {out_, "maps/scan_of_patient.ply"});
  EXPECT_EQ(ContentOf(out_), before);
}

TEST_F(BadInput, EarlierRunIsKeptUnlessOverwriteIsSaid) {
  ASSERT_EQ(Run().exit_code, 0);
  const auto before = ContentOf(out_);
  ExpectOutcome(Run(), kExitInTheWay, {out_, "holds a run already", "--overwrite"});
  EXPECT_EQ(ContentOf(out_), before);
}

TEST_F(BadInput, EarlierRunIsReplacedWhole) {
  ASSERT_EQ(Run().exit_code, 0);
  Write("out/trajectory/map_0007.tum", "of the earlier run");
  Write("out/frames.csv.partial-77", "of a killed run");
  const CommandResult again = Run({"--overwrite"});
  EXPECT_EQ(again.exit_code, 0) << again.ToString();
  EXPECT_EQ(FilesBelow(out_ + "/trajectory"), std::vector<std::string>{"live.tum"});
  EXPECT_FALSE(Exists(out_ + "/frames.csv.partial-77"));
  EXPECT_FALSE(Exists(out_ + "/trajectory/map_0007.tum"));
  EXPECT_EQ(ReadCsv(out_ + "/frames.csv").size(), 3u);
}

TEST_F(BadInput, EarlierRunIsKeptWhenTheNextCannotStart) {
  ASSERT_EQ(Run().exit_code, 0);
  const auto before = ContentOf(out_);
  HideCudaDevices();
  ExpectOutcome(Run({"--overwrite", "--device", "cuda"}), kExitUnavailable, {"cuda"});
  ExpectOutcome(Run({"--overwrite", "--set", "features.max=1"}), kExitConfig, {"features.max"});
  ExpectOutcome(Run({"--overwrite", "--save-atlas", scratch_ + "/none/a.atlas"}), kExitIo, {"a.atlas"});
  fs::remove_all(sequence_);
  ExpectOutcome(Run({"--overwrite"}), kExitNoInput, {sequence_});
  EXPECT_EQ(ContentOf(out_), before);
}

TEST_F(BadInput, AutoDeviceIsTheCpuWhereThereIsNoOther) {
  HideCudaDevices();
  const CommandResult run = Run({"--device", "auto"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  EXPECT_EQ(ReadJson(out_ + "/summary.json").at("device"), "cpu");
  EXPECT_NE(run.out.find("device          cpu"), std::string::npos) << run.out;
}

// An answer that is lost is an error, whatever was found.
TEST_F(BadInput, FullOutputIsAnError) {
  for (const std::string& arguments :
       std::vector<std::string>{"plan --device cpu", "--help", "plan --help", "evaluate " + ResultFolder("standard"),
                                "run --print-config"}) {
    const CommandResult result =
        Command({"/bin/sh", "-c", HAUSTRA_BINARY " " + arguments + " > /dev/full"}).Wait(kHangLimit);
    ExpectOutcome(result, kExitIo, {"haustra: the output cannot be written: No space left on device"});
  }
}

TEST_F(BadInput, ReaderThatHasSeenEnoughIsNoError) {
  const std::string script = "{ " HAUSTRA_BINARY " run --print-config; echo $? > " + scratch_ + "/code; } | true";
  EXPECT_EQ(Command({"/bin/sh", "-c", script}).Wait(kHangLimit).exit_code, 0);
  EXPECT_EQ(ReadBytes(scratch_ + "/code"), "0\n");
}

TEST_F(BadInput, QuietCommandsAnswer) {
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"plan", "--device", "cpu"}, {"evaluate", ResultFolder("standard")}, {"run", "--print-config"}}) {
    std::vector<std::string> quiet = arguments;
    quiet.push_back("--quiet");
    EXPECT_EQ(Haustra(quiet).out, Haustra(arguments).out) << arguments.front();
    EXPECT_NE(Haustra(quiet).out, "");
  }
}

// What a run has written is also what an export would write.
TEST_F(BadInput, ExportLeavesTheMapsOfARunAlone) {
  const std::string run = scratch_ + "/run";
  fs::copy(ResultFolder("standard"), run, fs::copy_options::recursive);
  const auto before = ContentOf(run);
  for (const char* folder : {"/maps", "/trajectory", ""}) {
    ExpectOutcome(Haustra({"export", run, "--format", "ply", "--out", run + folder, "--overwrite"}), kExitInTheWay,
                  {run + folder});
  }
  EXPECT_EQ(ContentOf(run), before);
}

TEST_F(BadInput, InputsInTheOutputFolderAreKept) {
  const std::string calibration = Write("out/calib.yaml", ReadBytes(sequence_ + "/calib.yaml"));
  const auto before = ContentOf(out_);
  ExpectOutcome(Run({"--calibration", calibration, "--overwrite"}), kExitInTheWay, {calibration + ", which is read"});
  EXPECT_EQ(ContentOf(out_), before);
  const std::string truth = Write("truth.txt", ReadBytes(SequenceFolder("standard") + "/groundtruth.txt"));
  ExpectOutcome(Haustra({"evaluate", ResultFolder("standard"), "--groundtruth", truth, "--json", truth, "--overwrite"}),
                kExitInTheWay, {truth + ": is read"});
}

TEST_F(BadInput, QuietRunSaysNothing) {
  const CommandResult run = Run({"--quiet"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(run.out + run.err, "");
  ExpectOutcome(Run({"--quiet"}), kExitInTheWay, {out_});
}

TEST_F(BadInput, MessagesHaveNoCodesInThemAndLogsNoCarriageReturns) {
  const CommandResult good = Run();
  ASSERT_EQ(good.exit_code, 0);
  EXPECT_EQ((good.out + good.err).find('\r'), std::string::npos);
  fs::remove_all(sequence_ + "/frames");
  fs::create_directories(sequence_ + "/frames");
  const CommandResult bad = Run({"--overwrite"});
  EXPECT_EQ(bad.exit_code, kExitBadData);
  EXPECT_EQ(bad.err.find("invalid argument"), std::string::npos) << bad.err;
}

TEST_F(BadInput, PartOfTheSequenceIsChosen) {
  const CommandResult run = Run({"--first-frame", "1", "--last-frame", "1"});
  ASSERT_EQ(run.exit_code, 0) << run.ToString();
  CsvRows frames = ReadCsv(out_ + "/frames.csv");
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0]["timestamp_ns"], "40000000");
}

TEST_F(BadInput, ReportIsLeftOutWhenNotWanted) {
  ASSERT_EQ(Run({"--report", "off"}).exit_code, 0);
  EXPECT_FALSE(Exists(out_ + "/report.html"));
  ASSERT_EQ(Run({"--overwrite"}).exit_code, 0);
  EXPECT_TRUE(Exists(out_ + "/report.html"));
}

TEST_F(BadInput, MissingCalibrationOfAMeasurementNamesTheCommandThatEstimatesOne) {
  fs::remove(sequence_ + "/calib.yaml");
  const std::string advice = "'haustra calibrate " + sequence_ + " --out " + sequence_ + "/calib.yaml' estimates one";
  for (const char* command : {"latency", "soak"}) {
    ExpectOutcome(HaustraOnCpu({command, sequence_}), kExitNoInput, {advice});
  }
  ExpectOutcome(Haustra({"plan", "--sequence", sequence_}), kExitNoInput, {advice});
}

TEST_F(BadInput, FileThatIsNoAtlasIsNamed) {
  ExpectOutcome(Haustra({"atlas", "info", scratch_ + "/none"}), kExitNoInput, {scratch_ + "/none: no such file"});
  ExpectOutcome(Haustra({"atlas", "info", scratch_}), kExitBadData, {scratch_ + ": is a folder, not a file"});
  ExpectOutcome(Haustra({"atlas", "info", sequence_ + "/calib.yaml"}), kExitBadData, {"no atlas file"});
}

TEST_F(BadInput, FolderInThePlaceOfAFileIsNamed) {
  const std::string refusal = sequence_ + ": is a folder, not a file";
  for (const char* option : {"--calibration", "--mask", "--marks", "--load-atlas"}) {
    ExpectRefusal(kExitBadData, {refusal}, {option, sequence_});
  }
  ExpectOutcome(Haustra({"evaluate", ResultFolder("standard"), "--groundtruth", sequence_}), kExitBadData, {refusal});
  ExpectOutcome(HaustraOnCpu({"latency", sequence_, "--require", sequence_}), kExitBadData, {refusal});
}

// Before a camera is estimated, which may take minutes.
TEST_F(BadInput, AtlasToLoadIsLookedAtFirst) {
  fs::remove(sequence_ + "/calib.yaml");
  for (const auto& [atlas, code] : {std::pair{scratch_ + "/none.atlas", kExitNoInput},
                                    {sequence_, kExitBadData},
                                    {Write("no.atlas", "not an atlas"), kExitBadData}}) {
    const CommandResult run = Run({"--load-atlas", atlas});
    ExpectOutcome(run, code, {atlas + ": "});
    EXPECT_EQ(run.err.find("estimat"), std::string::npos) << run.err;
    EXPECT_FALSE(Exists(out_));
  }
}

TEST_F(BadInput, FileThatIsNoVideoIsSaidToBeNone) {
  sequence_ = Write("clip.mp4", "not a video");
  const CommandResult run = Run();
  ExpectOutcome(run, kExitBadData, {sequence_});
  EXPECT_EQ(run.err.find("calib.yaml"), std::string::npos) << "a calibration would not help: " << run.err;
  EXPECT_FALSE(Exists(out_));
}

TEST_F(BadInput, FolderOfAFileToWriteIsLookedForBeforeTheWork) {
  const std::string file = scratch_ + "/none/file";
  ExpectOutcome(HaustraOnCpu({"calibrate", sequence_, "--out", file}), kExitIo, {file, "its folder does not exist"});
  ExpectOutcome(HaustraOnCpu({"soak", sequence_, "--csv", file}), kExitIo, {file, "its folder does not exist"});
  ExpectRefusal(kExitIo, {file, "its folder does not exist"}, {"--save-atlas", file});
}

TEST_F(BadInput, FilesThatAreThereAreKeptUnlessOverwriteIsSaid) {
  const std::string file = Write("results.json", "precious");
  const std::string kept = file + ": exists already and is not ";
  ExpectOutcome(Haustra({"evaluate", ResultFolder("standard"), "--json", file}), kExitInTheWay, {kept});
  ExpectOutcome(Haustra({"report", ResultFolder("standard"), "--html", file}), kExitInTheWay, {kept});
  ExpectOutcome(HaustraOnCpu({"calibrate", sequence_, "--out", file}), kExitInTheWay, {kept});
  ExpectOutcome(HaustraOnCpu({"soak", sequence_, "--csv", file}), kExitInTheWay, {kept});
  ExpectOutcome(Run({"--save-atlas", file}), kExitInTheWay, {kept});
  ExpectOutcome(Run({"--save-atlas", file, "--overwrite"}), kExitInTheWay, {kept});
  EXPECT_EQ(ReadBytes(file), "precious");
  const std::string earlier = Write("earlier.json", "{\n  \"run\": \"earlier\"\n}\n");
  std::vector<std::string> evaluate = {"evaluate", ResultFolder("standard"), "--json", earlier};
  ExpectOutcome(Haustra(evaluate), kExitInTheWay, {earlier, "--overwrite"});
  evaluate.emplace_back("--overwrite");
  EXPECT_EQ(Haustra(evaluate).exit_code, kExitOk);
  EXPECT_EQ(ReadBytes(earlier).find("\"earlier\""), std::string::npos);
}

TEST_F(BadInput, WrongCommandLinesAreUsageErrors) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"walk"},
      {"run"},
      {"run", sequence_},
      {"run", sequence_, "--out"},
      {"run", sequence_, "--out", out_, "--mode", "sometimes"},
      {"run", sequence_, "--out", out_, "--rate", "0"},
      {"run", sequence_, "--out", out_, "--rate", "-1"},
      {"run", sequence_, "--out", out_, "--rate", "fast"},
      {"run", sequence_, "--out", out_, "--rate", "0.5"},
      {"run", sequence_, "--out", out_, "--seed", "-5"},
      {"run", sequence_, "--out", out_, "--threads", "-2"},
      {"run", sequence_, "--out", out_, "--every-nth", "0"},
      {"run", sequence_, "--out", out_, "--device", "abacus"},
      {"run", sequence_, "--out", out_, "--colour"},
      {"run", sequence_, sequence_, "--out", out_},
      {"evaluate"},
      {"render"},
      {"soak", sequence_, "--mode", "sequential", "--rate", "2"},
      {"soak", sequence_, "--minutes", "1"},
      {"soak", sequence_, "--minutes", "2.1"},
      {"soak", sequence_, "--minutes", "10", "--procedure", "1"},
  };
  for (const std::vector<std::string>& arguments : wrong) {
    const CommandResult result = Haustra(arguments);
    EXPECT_EQ(result.exit_code, kExitUsage) << testing::PrintToString(arguments) << "\n" << result.ToString();
    EXPECT_FALSE(result.out.empty() && result.err.empty());
    EXPECT_FALSE(Exists(out_));
  }
}

TEST_F(BadInput, HelpAndVersionAreNoErrors) {
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"--help"}, {"--version"}, {"run", "--help"}, {"evaluate", "--help"}}) {
    const CommandResult result = Haustra(arguments);
    EXPECT_EQ(result.exit_code, kExitOk) << result.ToString();
    EXPECT_FALSE(result.out.empty());
  }
  EXPECT_TRUE(Haustra({"--version"}).out.starts_with("haustra " HAUSTRA_VERSION));
  EXPECT_NE(Haustra({"latency", "--help"}).out.find("  73 "), std::string::npos);
}

TEST_F(BadInput, EvaluationWithoutGroundTruthOrRunNamesWhatIsMissing) {
  ExpectOutcome(Haustra({"evaluate", ResultFolder("standard"), "--groundtruth", scratch_ + "/none.txt"}), kExitNoInput,
                {"none.txt"});
  ExpectOutcome(Haustra({"evaluate", out_, "--groundtruth", SequenceFolder("standard") + "/groundtruth.txt"}),
                kExitNoInput, {out_});
}

// Long enough for a map before the damage.
class DamagedSequence : public testing::Test {
 protected:
  static constexpr int kNumFrames = 60;

  void SetUp() override {
    const std::string scratch = ScratchFolder();
    sequence_ = scratch + "/sequence";
    out_ = scratch + "/out";
    CopySequence(SequenceFolder("standard"), sequence_, kNumFrames);
  }
  void Truncate(int index) const {
    WriteBytes(FramePath(sequence_, index), ReadBytes(FramePath(sequence_, index)).substr(0, 700));
  }
  // The run goes through, counts these frames as damaged, says so, and has a map before and after each of them.
  void ExpectOnlyTheseAreLost(const std::vector<int>& damaged) const {
    const CommandResult run = HaustraOnCpu({"run", sequence_, "--out", out_});
    ASSERT_EQ(run.exit_code, kExitOk) << run.ToString();
    CsvRows frames = ReadCsv(out_ + "/frames.csv");
    ASSERT_EQ(frames.size(), static_cast<std::size_t>(kNumFrames));
    EXPECT_EQ(ReadJson(out_ + "/summary.json").at("damaged").get<std::size_t>(), damaged.size());
    std::map<std::string, std::string> damage_stamps;
    for (auto& event : ReadCsv(out_ + "/events.csv")) {
      if (event["event"] == "frame_damaged") damage_stamps[event["frame_idx"]] = event["timestamp_ns"];
    }
    EXPECT_EQ(damage_stamps.size(), damaged.size());
    for (const int index : damaged) {
      auto& frame = frames[index];
      EXPECT_EQ(frame["reason"], "damaged_frame");
      EXPECT_EQ(frame["map_id"], "-1");
      EXPECT_EQ(damage_stamps[std::to_string(index)], frame["timestamp_ns"]);
      EXPECT_NE(run.err.find(fs::path(FramePath(sequence_, index)).filename().string()), std::string::npos) << run.err;
    }
    int num_localised = 0;
    for (auto& frame : frames) num_localised += frame["map_id"] != "-1";
    EXPECT_GE(num_localised, kNumFrames - static_cast<int>(damaged.size()) - 15);
    EXPECT_TRUE(Exists(out_ + "/trajectory/map_0000.tum"));
  }

  std::string sequence_, out_;
};

TEST_F(DamagedSequence, TruncatedImageInTheMiddleCostsItsFrameOnly) {
  Truncate(30);
  ExpectOnlyTheseAreLost({30});
}

TEST_F(DamagedSequence, ImageOfAnotherSizeInTheMiddleCostsItsFrameOnly) {
  fs::copy_file(SequenceFolder("other_size") + "/frames/000000.jpg", FramePath(sequence_, 30),
                fs::copy_options::overwrite_existing);
  ExpectOnlyTheseAreLost({30});
}

TEST_F(DamagedSequence, BrokenImagesAtBothEndsCostTheirFramesOnly) {
  Truncate(0);
  Truncate(kNumFrames - 1);
  ExpectOnlyTheseAreLost({0, kNumFrames - 1});
}

}  // namespace
}  // namespace haustra::end_to_end
