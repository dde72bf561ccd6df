// `haustra calibrate` and runs without a calibration, on a colon that the program renders itself.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "capture/calibration_reader.h"
#include "capture/codec/image_codec.h"
#include "tests/end_to_end/command.h"
#include "tests/end_to_end/result_files.h"
#include "tools/exit_codes.h"

namespace haustra::end_to_end {
namespace {

namespace fs = std::filesystem;

constexpr double kTrueFocalPx = 197.3;  // of the renderer at 360x270

class Calibrate : public testing::Test {
 protected:
  void SetUp() override {
    scratch_ = ScratchFolder();
    out_ = scratch_ + "/calib.yaml";
  }
  CommandResult Run(const std::string& sequence, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"calibrate", sequence, "--out", out_, "--device", "cpu"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Haustra(arguments);
  }
  void ExpectRefusal(const CommandResult& result, int exit_code, const std::string& word) const {
    EXPECT_EQ(result.exit_code, exit_code) << result.ToString();
    EXPECT_NE(result.err.find(word), std::string::npos) << result.ToString();
    EXPECT_FALSE(Exists(out_));
  }

  std::string scratch_, out_;
};

// By its own command, and by a run that has no calibration: on any number of threads it is the same to the bit.
TEST_F(Calibrate, FindsTheFocalLengthOfARenderedClipAndARunFindsTheSame) {
  const std::string picture = scratch_ + "/residuals.png";
  const CommandResult first = Run(SequenceFolder("losses"), {"--picture", picture, "--threads", "2"});
  ASSERT_EQ(first.exit_code, kExitOk) << first.ToString();
  EXPECT_NE(first.out.find("focal length"), std::string::npos);
  const Result<CameraCalibration> calibration = ReadCalibration(out_);
  ASSERT_TRUE(calibration.ok()) << calibration.status().ToString();
  EXPECT_NEAR(std::log(calibration->fx / kTrueFocalPx), 0.0, 0.03);
  EXPECT_EQ(calibration->width_px, 360);
  EXPECT_EQ(calibration->height_px, 270);
  const Result<Image> image = ReadImage(picture, ChannelChoice::kAsStored);
  ASSERT_TRUE(image.ok()) << image.status().ToString();
  EXPECT_EQ(image->width(), 360);

  const std::string sequence = scratch_ + "/sequence", out = scratch_ + "/run";
  fs::create_directories(sequence);
  fs::create_directory_symlink(SequenceFolder("losses") + "/frames", sequence + "/frames");
  for (const char* name : {"times.txt", "mask.png"}) {
    fs::copy_file(SequenceFolder("losses") + "/" + name, sequence + "/" + name);
  }
  const CommandResult run = HaustraOnCpu({"run", sequence, "--out", out, "--threads", "1"});
  ASSERT_EQ(run.exit_code, kExitOk) << run.ToString();
  EXPECT_NE(run.err.find("estimating"), std::string::npos) << run.err;
  std::string written = ReadBytes(out_);
  const std::string remark = "# Estimated by haustra calibrate\n";
  ASSERT_NE(written.find(remark), std::string::npos) << written;
  EXPECT_EQ(ReadBytes(out + "/calib.yaml"), written.erase(written.find(remark), remark.size()));
  const auto summary = ReadJson(out + "/summary.json");
  EXPECT_EQ(summary.at("calibration").at("source"), "estimated");
  EXPECT_NEAR(summary.at("calibration").at("focal_px").at("value").get<double>(), calibration->fx, 0.1);
  EXPECT_GT(summary.at("coverage").get<double>(), 50.0);
}

TEST_F(Calibrate, ARunWithACalibrationSaysThatItWasGiven) {
  EXPECT_EQ(ReadJson(ResultFolder("losses") + "/summary.json").at("calibration").at("source"), "given");
  EXPECT_FALSE(Exists(ResultFolder("losses") + "/calib.yaml"));
}

// The true focal length is 0.548 of the width of the picture; ten frames say nothing about it.
TEST_F(Calibrate, ARunThatCannotEstimateGuessesAndSaysSo) {
  const std::string sequence = scratch_ + "/sequence", out = scratch_ + "/run", again = scratch_ + "/again";
  CopySequence(SequenceFolder("losses"), sequence, 10);
  fs::remove(sequence + "/calib.yaml");
  const std::string sentence = "shapes may be stretched by that much";
  const CommandResult run = HaustraOnCpu({"run", sequence, "--out", out});
  ASSERT_EQ(run.exit_code, kExitOk) << run.ToString();
  EXPECT_NE(run.err.find("10 frames are too few"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find(sentence), std::string::npos) << run.err;
  const auto calibration = ReadJson(out + "/summary.json").at("calibration");
  EXPECT_EQ(calibration.at("source"), "guessed");
  EXPECT_NE(calibration.at("note").get<std::string>().find(sentence), std::string::npos);
  EXPECT_NE(ReadBytes(out + "/report.html").find(sentence), std::string::npos);
  const Result<CameraCalibration> guess = ReadCalibration(out + "/calib.yaml");
  ASSERT_TRUE(guess.ok()) << guess.status().ToString();
  EXPECT_GT(guess->focal_guess_sigma, 0.1);
  EXPECT_LT(std::abs(std::log(guess->fx / kTrueFocalPx)), 2.0 * guess->focal_guess_sigma);

  // The file says so wherever it is used.
  const CommandResult with_file = HaustraOnCpu({"run", sequence, "--calibration", out + "/calib.yaml", "--out", again});
  ASSERT_EQ(with_file.exit_code, kExitOk) << with_file.ToString();
  EXPECT_NE(with_file.err.find(sentence), std::string::npos) << with_file.err;
  EXPECT_EQ(ReadJson(again + "/summary.json").at("calibration").at("source"), "given");
}

TEST_F(Calibrate, RefusesWhatIsNotThereOrTooShort) {
  ExpectRefusal(Run(scratch_ + "/none"), kExitNoInput, "none");
  ExpectRefusal(Run(SequenceFolder("losses"), {"--last-frame", "9"}), kExitConfig, "10 frames are too few");
  EXPECT_EQ(HaustraOnCpu({"calibrate", SequenceFolder("losses")}).exit_code, kExitUsage);
  EXPECT_EQ(Run("v4l2:/dev/video0").exit_code, kExitUsage);
}

TEST_F(Calibrate, RefusesAPictureThatStandsStill) {
  const std::string sequence = scratch_ + "/sequence";
  CopySequence(SequenceFolder("losses"), sequence, 40);
  for (int i = 1; i < 40; ++i) {
    fs::copy_file(FramePath(sequence, 0), FramePath(sequence, i), fs::copy_options::overwrite_existing);
  }
  ExpectRefusal(Run(sequence), kExitConfig, "does not move");
}

}  // namespace
}  // namespace haustra::end_to_end
