// What --overwrite may replace where a command writes one file: its own earlier files, and nothing else.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "capture/calibration_reader.h"
#include "tests/capture/temp_folder.h"
#include "tests/tools/command/call_command.h"
#include "tools/calibrate/calibrate_command.h"
#include "tools/evaluate/evaluate_command.h"
#include "tools/exit_codes.h"
#include "tools/report/report_command.h"
#include "tools/run/run_command.h"
#include "tools/soak/soak_command.h"
#include "tools/vocabulary/vocabulary_command.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// Each before its inputs are looked at, so that none is there.
std::vector<std::vector<std::string>> CommandsThatWriteOneFile(const TempFolder& folder, const std::string& file) {
  const std::string run = folder.Path("run"), sequence = folder.Path("sequence");
  return {{"report", run, "--html", file},
          {"evaluate", run, "--json", file},
          {"evaluate", run, "--table", file},
          {"run", sequence, "--out", folder.Path("other"), "--save-atlas", file},
          {"calibrate", sequence, "--out", file},
          {"calibrate", sequence, "--out", folder.Path("new.yaml"), "--picture", file},
          {"vocabulary", "--rendered", "1", "--pictures", "2", "--features", "100", "--out", file},
          {"soak", sequence, "--csv", file}};
}

CommandAnswer Call(std::vector<std::string> arguments) {
  arguments.emplace_back("--overwrite");
  return CallCommand(
      {AddReportCommand, AddEvaluateCommand, AddRunCommand, AddCalibrateCommand, AddVocabularyCommand, AddSoakCommand},
      arguments);
}

TEST(OutputFile, WhatNoneOfTheCommandsMadeIsNeverReplaced) {
  const TempFolder folder;
  const std::string table = "frame_idx,timestamp_ns,state\n0,0,tracking\n";
  folder.Write("run/frames.csv", table);
  const std::string file = folder.Path("run/frames.csv");
  for (const std::vector<std::string>& command : CommandsThatWriteOneFile(folder, file)) {
    const CommandAnswer answer = Call(command);
    EXPECT_EQ(answer.code, kExitInTheWay) << command[0];
    EXPECT_THAT(answer.err, HasSubstr(file + ": exists already and is not ")) << command[0];
    EXPECT_EQ(folder.Read("run/frames.csv"), table) << command[0];
  }
}

TEST(OutputFile, PictureOfTheSequenceIsNotReplacedByAnother) {
  const TempFolder folder;
  folder.WriteImage("sequence/frames/000000.png", FlatImage(8, 8, PixelFormat::kGrey8, 90));
  const std::string picture = folder.Path("sequence/frames/000000.png");
  const CommandAnswer answer =
      Call({"calibrate", folder.Path("sequence"), "--out", folder.Path("new.yaml"), "--picture", picture});
  EXPECT_EQ(answer.code, kExitInTheWay);
  EXPECT_THAT(answer.err, HasSubstr(picture + ": lies in " + folder.Path("sequence") + ", which is read"));
}

// A rendered sequence has the true calibration in it.
TEST(OutputFile, CalibrationOfAnotherCommandIsNotReplacedByAnEstimate) {
  const TempFolder folder;
  CameraCalibration exact{CameraModelKind::kKannalaBrandt, 64, 48, 60, 60, 32, 24};
  const std::string file = folder.Path("calib.yaml");
  for (const double max_half_angle_deg : {0.0, 80.0}) {
    exact.max_half_angle_deg = max_half_angle_deg;
    ASSERT_TRUE(WriteCalibration(file, exact).ok());
    const std::string before = folder.Read("calib.yaml");
    const CommandAnswer answer = Call({"calibrate", folder.Path("sequence"), "--out", file});
    EXPECT_EQ(answer.code, kExitInTheWay);
    EXPECT_THAT(answer.err, HasSubstr(file + ": exists already and is not an estimate of haustra calibrate"));
    EXPECT_EQ(folder.Read("calib.yaml"), before);
    // Its own may be replaced; then it is the sequence that is not there.
    ASSERT_TRUE(WriteCalibration(file, exact, kEstimateRemark).ok());
    EXPECT_EQ(Call({"calibrate", folder.Path("sequence"), "--out", file}).code, kExitNoInput);
  }
}

TEST(OutputFile, TwoOutputsOfACommandAreTwoFiles) {
  const TempFolder folder;
  const std::string run = folder.Path("run"), sequence = folder.Path("sequence"), plain = folder.Path("f.csv");
  folder.Write("run/frames.csv", "");
  std::filesystem::create_directory_symlink(run, folder.Path("link"));
  for (const auto& [a, b] :
       {std::pair(plain, plain), {plain, folder.Path("run/../f.csv")}, {run + "/f.csv", folder.Path("link/f.csv")}}) {
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"evaluate", run, "--json", a, "--table", b},
          {"calibrate", sequence, "--out", a, "--picture", b}}) {
      const CommandAnswer answer = Call(command);
      EXPECT_EQ(answer.code, kExitUsage) << command[0] << a << b;
      EXPECT_THAT(answer.err, HasSubstr(command[2] + " " + a)) << command[0];
      EXPECT_THAT(answer.err, HasSubstr("name the same file")) << command[0];
      EXPECT_FALSE(std::filesystem::exists(a));
    }
  }
  const CommandAnswer answer = Call({"run", sequence, "--out", run, "--save-atlas", folder.Path("link/frames.csv")});
  EXPECT_EQ(answer.code, kExitUsage);
  EXPECT_THAT(answer.err, HasSubstr("is a file of a run, which " + run + " is to hold"));
}

}  // namespace
}  // namespace haustra
