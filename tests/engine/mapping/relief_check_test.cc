// Young maps of a synthetic colon: a right one, and one that took a wrong minimum of each pair. The truth is the
// geometry of the colon.
#include "engine/mapping/relief_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/atlas/invariants.h"
#include "engine/geometry/constants.h"
#include "engine/geometry/triangulation.h"
#include "engine/mapping/local_bundle.h"
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

  // Of the pair's own minima the best one that goes elsewhere than the scope did; of unit length. Zero: none.
  SE3 OtherMinimum(const Keyframe& a, const Keyframe& b, const SE3& b_from_a) {
    ViewPair pair(colon_.config(), noise_, colon_.camera(), colon_.device());
    EXPECT_TRUE(pair.Compare(a, b));
    TwoViewRansac ransac(SyntheticColon::kMaxFeatures);
    TwoViewRansac::Estimate estimate;
    EXPECT_TRUE(ransac.Run(pair.bearings_a(), pair.bearings_b(), pair.tolerance_rad(), {}, colon_.rng(), &estimate));
    SE3 best;
    double best_score = 0.0;
    for (int i = 0; i < 200; ++i) {
      SE3 start(b_from_a.rotation, RandomDirection(colon_.rng()));
      const double score = ransac.Descend(&start);
      const double off =
          std::acos(std::clamp(std::abs(start.translation.dot(b_from_a.translation.normalized())), 0.0, 1.0));
      if (off < 0.7 || score <= best_score) continue;
      best_score = score;
      best = start;
    }
    return best;
  }

  // As of a founding that took another motion for the true one. The points lie where the poses put them.
  void TakeOtherMinima() {
    for (int i = 0; i + 1 < kNum; ++i) {
      const SE3 truth = FromNewest(colon_.frames()[i].cam_from_world);
      SE3 wrong = OtherMinimum(atlas_.keyframe(newest_), atlas_.keyframe(colon_.frames()[i].keyframe), truth);
      ASSERT_GT(wrong.translation.norm(), 0.5) << "the pair " << i << " has no other minimum";
      wrong.translation *= truth.translation.norm();
      atlas_.keyframe(colon_.frames()[i].keyframe).cam_from_map = wrong * atlas_.keyframe(newest_).cam_from_map;
    }
    std::vector<MapPointHandle> points;
    atlas_.points().ForEach([&](MapPointHandle handle, const MapPoint&) { points.push_back(handle); });
    for (const MapPointHandle handle : points) {
      MapPoint& point = atlas_.point(handle);
      const Observation& first = point.observations[0];
      const Observation& second = point.observations[1];
      const Keyframe& a = atlas_.keyframe(first.keyframe);
      const Keyframe& b = atlas_.keyframe(second.keyframe);
      Triangulated found;
      if (!TriangulateBearings(b.cam_from_map * a.cam_from_map.Inverse(), a.features.bearing(first.feature_idx),
                               b.features.bearing(second.feature_idx), &found)) {
        found.point_in_a = 1.5 * a.features.bearing(first.feature_idx);
      }
      point.position = a.cam_from_map.Inverse() * found.point_in_a;
      atlas_.UpdatePoint(handle);
    }
  }
  SE3 FromNewest(const SE3& pose) const { return pose * colon_.FrameOf(newest_).cam_from_world.Inverse(); }
  std::vector<SE3> Poses() const {
    std::vector<SE3> poses;
    for (const auto& frame : colon_.frames()) poses.push_back(atlas_.keyframe(frame.keyframe).cam_from_map);
    return poses;
  }
  static void ExpectSame(const std::vector<SE3>& a, const std::vector<SE3>& b) {
    for (int i = 0; i < kNum; ++i) {
      EXPECT_EQ(a[i].translation, b[i].translation) << i;
      EXPECT_EQ(a[i].rotation.coeffs(), b[i].rotation.coeffs()) << i;
    }
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
  const std::vector<SE3> before = Poses();
  EXPECT_FALSE(Correct());
  ExpectSame(Poses(), before);
}

// Four of five pairs are against it, but the bundle that comes next finds the truth from there. That the check builds
// anew what no bundle mends is tested on a rendered colon (tests/end_to_end/relief_test.cc).
TEST_F(ReliefCheckTest, LeavesAMapToItsBundleThatABundleMends) {
  TakeOtherMinima();
  const std::vector<SE3> before = Poses();
  EXPECT_FALSE(Correct());
  ExpectSame(Poses(), before);
  LocalBundle bundle(colon_.config(), noise_, colon_.camera(), adjuster_);
  ASSERT_TRUE(bundle.Adjust(newest_, {kNum, true, 40}, {}, &atlas_).ok());
  const SE3 map_from_newest = atlas_.keyframe(newest_).cam_from_map.Inverse();
  for (int i = 0; i + 1 < kNum; ++i) {
    const SE3 now = atlas_.keyframe(colon_.frames()[i].keyframe).cam_from_map * map_from_newest;
    EXPECT_LT(now.rotation.angularDistance(FromNewest(colon_.frames()[i].cam_from_world).rotation), kDegree) << i;
  }
}

}  // namespace
}  // namespace haustra::test
