#include "tools/render/revisits.h"

#include <gtest/gtest.h>

namespace haustra::render {
namespace {

// Out along z by 4 mm a second for half of the time, and back.
std::vector<SE3> OutAndBack(int count, double rate_hz) {
  std::vector<SE3> poses;
  for (int i = 0; i < count; ++i) {
    const double t = i / rate_hz, turn = 0.5 * count / rate_hz;
    poses.emplace_back(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 4.0 * (t < turn ? t : 2.0 * turn - t)));
  }
  return poses;
}

TEST(FindRevisits, OutAndBackGivesTheMirroredFrames) {
  const auto revisits = FindRevisits(OutAndBack(750, 25.0), 25.0, {});
  ASSERT_FALSE(revisits.empty());
  for (const Revisit& r : revisits) {
    EXPECT_NEAR(r.dt_s, (r.frame_b - r.frame_a) / 25.0, 1e-9);
    EXPECT_GE(r.dt_s, 10.0);
    EXPECT_LE(r.distance_mm, 10.0);
    // Near the turning point the mirrored frame comes too soon.
    if (750 - 2 * r.frame_a < 260) continue;
    EXPECT_NEAR(r.frame_a + r.frame_b, 750, 5);  // candidates are five frames apart
    EXPECT_LT(r.distance_mm, 1.0);
  }
}

TEST(FindRevisits, ViewsTurnedAwayAreNone) {
  std::vector<SE3> poses = OutAndBack(750, 25.0);
  for (int i = 375; i < 750; ++i) poses[i].rotation = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX());
  EXPECT_TRUE(FindRevisits(poses, 25.0, {}).empty());
}

TEST(FindRevisits, HiddenFramesAreNotUsed) {
  const std::vector<FrameSpan> hidden = {{500, 749, EventKind::kWater}};
  for (const Revisit& r : FindRevisits(OutAndBack(750, 25.0), 25.0, hidden)) EXPECT_LT(r.frame_b, 500);
}

}  // namespace
}  // namespace haustra::render
