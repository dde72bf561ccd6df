// Windows of a synthetic map whose newest keyframe is out of place.
#include "engine/mapping/local_bundle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/atlas/invariants.h"
#include "tests/engine/place/synthetic_colon.h"
#include "tests/hal/ticking_clock.h"

namespace haustra::test {
namespace {

class LocalBundleTest : public testing::Test {
 protected:
  LocalBundleTest() : colon_(3), atlas_(colon_.MakeAtlas()) {
    colon_.AddWall(0.0, 6.0, 2000);
    colon_.AddMap(&atlas_, 0.0, 2.0, 10, Sim3{});
    newest_ = colon_.frames().back().keyframe;
    // A proposal from a track that had slipped: nothing that this keyframe sees fits.
    atlas_.keyframe(newest_).cam_from_map.translation += Eigen::Vector3d(0.12, -0.08, 0.05);
  }

  // Stopped at the `num_looks`-th look at the clock, counted from 0; negative: never.
  Result<BundleSummary> Adjust(int num_looks, Atlas* atlas) {
    SchurBundleAdjuster adjuster;
    LocalBundle bundle(colon_.config(), noise_, colon_.camera(), adjuster);
    const TickingClock clock;
    const TimePoint deadline = num_looks < 0 ? kNoDeadline : TickingClock::DeadlineAtLook(num_looks);
    return bundle.Adjust(newest_, {10, true, 10}, {&clock, deadline, {}}, atlas);
  }
  double Error(const Atlas& atlas) const {
    const Eigen::Vector3d truth = colon_.frames().back().cam_from_world.InverseTranslation();
    return (atlas.keyframe(newest_).cam_from_map.InverseTranslation() - truth).norm();
  }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  KeyframeHandle newest_;
};

TEST_F(LocalBundleTest, FinishedItPutsTheKeyframeInPlaceAndKeepsWhatFits) {
  const double error = Error(atlas_);
  const int num_points = atlas_.keyframe(newest_).num_points;
  ASSERT_TRUE(Adjust(-1, &atlas_).ok());
  EXPECT_LT(Error(atlas_), 0.5 * error);
  EXPECT_GT(atlas_.keyframe(newest_).num_points, 0.8 * num_points);
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

// Wherever it is stopped, what it has gained stays, and no observation goes on the word of a state that is not final.
TEST_F(LocalBundleTest, StoppedItDeletesNoObservation) {
  const double error = Error(atlas_);
  for (int num_looks = 0; num_looks < 8; ++num_looks) {
    SCOPED_TRACE(num_looks);
    Atlas atlas = atlas_;
    ASSERT_TRUE(Adjust(num_looks, &atlas).ok());
    EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");
    EXPECT_EQ(atlas.points().size(), atlas_.points().size());
    atlas_.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
      EXPECT_EQ(atlas.keyframe(handle).num_points, keyframe.num_points) << keyframe.id;
    });
    if (num_looks == 0) {
      EXPECT_EQ(Error(atlas), error);
    } else {
      EXPECT_LT(Error(atlas), error);
    }
  }
}

class LocalBundleGateTest : public LocalBundleTest {
 protected:
  static constexpr int kNumMoved = 40;

  // Moves so many features of the last keyframe but one, by turns to the right and to the left, and has the window
  // adjusted. How many of them still see their points.
  int NumKept(double off_sigmas) {
    const auto& frame = colon_.frames()[colon_.frames().size() - 2];
    Keyframe& keyframe = atlas_.keyframe(frame.keyframe);
    std::vector<std::size_t> moved;
    for (std::size_t i = 0; i < keyframe.points.size() && moved.size() < kNumMoved; ++i) {
      if (!keyframe.points[i] || atlas_.point(keyframe.points[i]).observations.size() < 6) continue;
      Keypoint& keypoint = keyframe.features.keypoints[i];
      Eigen::Vector2d pixel;
      const Eigen::Vector3d& position = atlas_.point(keyframe.points[i]).position;
      EXPECT_TRUE(colon_.camera().Project(frame.cam_from_world * position, &pixel));
      keypoint.x_px = static_cast<float>(pixel.x() + (moved.size() % 2 == 0 ? 1 : -1) * off_sigmas *
                                                         noise_.SigmaPx(keypoint.scale_px));
      keypoint.y_px = static_cast<float>(pixel.y());
      moved.push_back(i);
    }
    EXPECT_EQ(moved.size(), kNumMoved);
    EXPECT_TRUE(Adjust(-1, &atlas_).ok());
    const Keyframe& after = atlas_.keyframe(frame.keyframe);
    return static_cast<int>(
        std::count_if(moved.begin(), moved.end(), [&](std::size_t i) { return after.points[i].is_valid(); }));
  }
};

// A point follows a moved feature by its share, so the gate of 3.03 sigmas lets one through that was moved by a little
// more.
TEST_F(LocalBundleGateTest, FeaturesNearTheGateKeepTheirPoints) { EXPECT_GT(NumKept(3.2), 0.8 * kNumMoved); }
TEST_F(LocalBundleGateTest, FeaturesFarBeyondItDoNot) { EXPECT_LT(NumKept(6.0), 0.2 * kNumMoved); }

}  // namespace
}  // namespace haustra::test
