#include "tools/calibrate/frame_plan.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

int NumWanted(const FramePlan& plan, std::uint32_t num_frames) {
  int num = 0;
  for (std::uint32_t i = 0; i < num_frames; ++i) num += plan.IsWanted(i);
  return num;
}

TEST(FramePlan, LooksAtEveryFrameOfAShortClip) { EXPECT_EQ(NumWanted(PlanFrames(400, 25.0, 720, 540), 400), 400); }

TEST(FramePlan, ThinsOutALongerOne) {
  const FramePlan plan = PlanFrames(1000, 25.0, 720, 540);
  EXPECT_EQ(plan.stride, 2u);
  EXPECT_EQ(plan.piece, 0u);
}

TEST(FramePlan, IsBoundedForAProcedureAndSpreadOverIt) {
  constexpr std::uint32_t kFrames = 33000;
  const FramePlan plan = PlanFrames(kFrames, 25.0, 1440, 1080);
  const int num = NumWanted(plan, kFrames);
  EXPECT_GE(num, 200);
  EXPECT_LE(num, 600);
  int in_last_quarter = 0;
  for (std::uint32_t i = kFrames / 4 * 3; i < kFrames; ++i) in_last_quarter += plan.IsWanted(i);
  EXPECT_GE(in_last_quarter, num / 6);
  // Whichever of its frames is the first that can be read.
  EXPECT_EQ(plan.PieceOf(plan.period - 1), 0u);
  EXPECT_EQ(plan.PieceOf(plan.period), 1u);
  EXPECT_EQ(plan.PieceOf(plan.period + 1), 1u);
}

TEST(FramePlan, GoesOnWithoutALength) { EXPECT_EQ(NumWanted(PlanFrames(0, 0.0, 720, 540), 1000), 500); }

}  // namespace
}  // namespace haustra
