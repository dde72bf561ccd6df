// One colon, one path, three cameras: 296x210 at 60 Hz, 720x540 at 25 and 1920x1080 at 30. What means an angle follows
// the focal length, what means a share of the picture its size, and what means a time the rate: the same floors hold
// for all, and maps begin and grow as fast.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/end_to_end/evaluation.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

class Cameras : public testing::TestWithParam<const char*> {
 protected:
  std::string sequence() const { return std::string("camera_") + GetParam(); }
};

INSTANTIATE_TEST_SUITE_P(, Cameras, testing::Values("296x210", "720x540", "1920x1080"),
                         [](const auto& camera) { return "Of" + std::string(camera.param); });

TEST_P(Cameras, ColonIsMappedOverAllVisibleFrames) {
  ExpectAtLeast({.sequence = sequence(), .coverage = 80, .visible_coverage = 95, .rms_ate_mm = 0.4, .maps = 1});
}

TEST_P(Cameras, OneLossIsRecoveredFrom) {
  const nlohmann::json evaluation = Evaluate(sequence());
  ASSERT_TRUE(evaluation.is_object());
  EXPECT_EQ(evaluation.at("maps_created").get<int>(), 1);
  EXPECT_GE(evaluation.at("live_visible_coverage").get<double>(), 78.0);
}

// The first pose comes a quarter of a second after the first picture, the last one when the sequence ends.
TEST_P(Cameras, MapIsFoundedAsSoon) {
  const CsvRows frames = ReadCsv(ResultFolder(sequence()) + "/frames.csv");
  ASSERT_FALSE(frames.empty());
  double first_s = 1e9;
  for (const auto& frame : frames) {
    if (frame.at("state") != "tracking") continue;
    first_s = std::stod(frame.at("timestamp_ns")) * 1e-9;
    break;
  }
  EXPECT_LE(first_s, 0.35);
  EXPECT_EQ(frames.back().at("state"), "tracking");
}

// A camera that brings more frames makes no more keyframes for it.
TEST_P(Cameras, KeyframesComeAsOften) {
  const CsvRows frames = ReadCsv(ResultFolder(sequence()) + "/frames.csv");
  const auto num_proposed =
      std::count_if(frames.begin(), frames.end(), [](const auto& frame) { return frame.at("is_keyframe") == "1"; });
  EXPECT_GE(num_proposed, 1);
  EXPECT_LE(num_proposed, 10);  // 1, 3 and 5 beside the two that found the map
}

}  // namespace
}  // namespace haustra::end_to_end
