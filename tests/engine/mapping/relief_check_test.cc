// Young maps of a synthetic colon, right ones and one whose poses are wrong, against what a relief check may touch.
#include "engine/mapping/relief_check.h"

#include <gtest/gtest.h>

#include "engine/atlas/invariants.h"
#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class ReliefCheckTest : public testing::Test {
 protected:
  static constexpr int kNum = 6;

  ReliefCheckTest() : colon_(11), atlas_(colon_.MakeAtlas()) {
    colon_.AddWall(0.0, 5.0, 1500);
    map_ = atlas_.CreateMap();
    for (int i = 0; i < kNum; ++i) colon_.AddKeyframe(&atlas_, map_, colon_.ViewFrom(0.12 * i), Sim3());
    colon_.AddPoints(&atlas_, 0, kNum, 0.002, [](int, int) { return 0; });
    newest_ = colon_.frames().back().keyframe;
    for (int i = kNum - 1; i-- > 0;) neighbours_.push_back({colon_.frames()[i].keyframe, 100});
  }

  bool Correct() {
    ReliefCheck check(colon_.config(), noise_, colon_.camera(), colon_.device(), adjuster_);
    const bool is_turned = check.Correct(newest_, neighbours_, &atlas_);
    EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
    return is_turned;
  }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  SchurBundleAdjuster adjuster_;
  Atlas atlas_;
  MapHandle map_;
  KeyframeHandle newest_;
  std::vector<Covisible> neighbours_;
};

TEST_F(ReliefCheckTest, LeavesARightMapAlone) {
  std::vector<SE3> before;
  for (const auto& frame : colon_.frames()) before.push_back(atlas_.keyframe(frame.keyframe).cam_from_map);
  EXPECT_FALSE(Correct());
  for (int i = 0; i < kNum; ++i) {
    const SE3& after = atlas_.keyframe(colon_.frames()[i].keyframe).cam_from_map;
    EXPECT_EQ(after.translation, before[i].translation);
    EXPECT_EQ(after.rotation.coeffs(), before[i].rotation.coeffs());
  }
}

TEST_F(ReliefCheckTest, WithTooFewPairsNothingIsSaid) {
  neighbours_.resize(2);
  EXPECT_FALSE(Correct());
}

}  // namespace
}  // namespace haustra::test
