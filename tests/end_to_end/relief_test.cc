// A tip that looks aside over a smooth wall: the founding takes the mirror of what is seen, and its scale runs away.
#include <gtest/gtest.h>

#include "tests/end_to_end/evaluation.h"
#include "tests/end_to_end/result_files.h"

namespace haustra::end_to_end {
namespace {

// 0.22 mm; 9.2 with mapping.relief_keyframes=0.
TEST(Relief, AYoungMapThatIsTheMirrorOfWhatIsSeenIsBuiltAnew) {
  const nlohmann::json summary = ReadJson(ResultFolder("tilted") + "/summary.json");
  EXPECT_GE(summary.at("mapping").at("reliefs_turned").get<int>(), 1);
  ExpectAtLeast({.sequence = "tilted", .coverage = 90, .visible_coverage = 90, .rms_ate_mm = 1.0, .maps = 1});
}

}  // namespace
}  // namespace haustra::end_to_end
