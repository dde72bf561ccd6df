// Tracks between keyframes of a synthetic colon: what is linked is held against the landmarks, whatever the map
// believes.
#include "engine/mapping/track_linker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/atlas/invariants.h"
#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

// Four keyframes whose points the map knows, and a fifth a step ahead without any.
class TrackLinkerTest : public testing::Test {
 protected:
  static constexpr int kKnown = 4;
  static constexpr double kStep = 0.12;

  TrackLinkerTest() : colon_(7), atlas_(colon_.MakeAtlas()) {
    colon_.AddWall(0.0, 5.0, 1500);
    map_ = atlas_.CreateMap();
    for (int i = 0; i < kKnown; ++i) colon_.AddKeyframe(&atlas_, map_, colon_.ViewFrom(kStep * i), Sim3());
    colon_.AddPoints(&atlas_, 0, kKnown, 0.002, [](int, int) { return 0; });
    newest_ = colon_.AddKeyframe(&atlas_, map_, colon_.ViewFrom(kStep * kKnown), Sim3());
    for (int i = kKnown; i-- > 0;) neighbours_.push_back({colon_.frames()[i].keyframe, 100});
  }

  // Points that the new keyframe needs for the wall's depth, given by its first `num` features that have one elsewhere.
  void ShareSome(int num) {
    const SyntheticColon::Frame& frame = colon_.FrameOf(newest_);
    for (std::size_t i = 0; i < frame.landmarks.size() && num > 0; ++i) {
      const MapPointHandle point = PointOf(frame.landmarks[i]);
      if (point && atlas_.AddObservation(point, newest_, static_cast<int>(i))) --num;
    }
    ASSERT_EQ(num, 0);
  }
  MapPointHandle PointOf(int landmark) const {
    MapPointHandle found;
    atlas_.points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
      const Observation& first = *point.observations.begin();
      if (colon_.FrameOf(first.keyframe).landmarks[first.feature_idx] == landmark) found = handle;
    });
    return found;
  }
  int LandmarkSeenBy(const Observation& observation) const {
    return colon_.FrameOf(observation.keyframe).landmarks[observation.feature_idx];
  }
  int Link() {
    TrackLinker linker(colon_.config(), noise_, colon_.camera(), colon_.device());
    created_.clear();
    const int gained = linker.Link(newest_, neighbours_, &atlas_, &created_);
    EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
    return gained;
  }
  // Share of the new keyframe's landmarks with a point in the map before, that it now observes.
  double ShareLinked() const {
    int num_known = 0, num_linked = 0;
    const SyntheticColon::Frame& frame = colon_.FrameOf(newest_);
    const Keyframe& keyframe = atlas_.keyframe(newest_);
    for (std::size_t i = 0; i < frame.landmarks.size(); ++i) {
      const MapPointHandle point = PointOf(frame.landmarks[i]);
      if (!point || std::find(created_.begin(), created_.end(), point) != created_.end()) continue;
      ++num_known;
      num_linked += keyframe.points[i] == point ? 1 : 0;
    }
    EXPECT_GT(num_known, 100);
    return static_cast<double>(num_linked) / num_known;
  }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  MapHandle map_;
  KeyframeHandle newest_;
  std::vector<Covisible> neighbours_;
  std::vector<MapPointHandle> created_;
};

TEST_F(TrackLinkerTest, GivesTheKeyframeThePointsThatItsNeighboursSee) {
  ShareSome(40);
  EXPECT_GT(Link(), 100);
  EXPECT_GT(ShareLinked(), 0.95);
  atlas_.points().ForEach([&](MapPointHandle, const MapPoint& point) {
    for (const Observation& observation : point.observations) {
      EXPECT_EQ(LandmarkSeenBy(observation), LandmarkSeenBy(*point.observations.begin()));
    }
  });
}

// The keyframe stands where the map's wrong scale would have it: half a step back. Guided search of a few sigmas would
// find what agrees with that; tracks by appearance do not ask.
TEST_F(TrackLinkerTest, DoesNotAskThePoseWhichPointsAreRight) {
  ShareSome(40);
  Keyframe& keyframe = atlas_.keyframe(newest_);
  keyframe.cam_from_map.translation += keyframe.cam_from_map.matrix3() * Eigen::Vector3d(0.0, 0.0, 0.5 * kStep);
  Link();
  EXPECT_GT(ShareLinked(), 0.9);
}

TEST_F(TrackLinkerTest, MakesPointsOfFeaturesThatNoneShowed) {
  ShareSome(40);
  Link();
  ASSERT_GT(created_.size(), 20u);
  std::vector<double> ratios;
  for (const MapPointHandle handle : created_) {
    const MapPoint& point = atlas_.point(handle);
    ASSERT_EQ(point.observations.size(), 2u);
    const SyntheticColon::Frame& frame = colon_.FrameOf(newest_);
    const int feature = atlas_.FeatureOf(point, newest_);
    const Eigen::Vector3d truth = frame.cam_from_world * colon_.landmark(frame.landmarks[feature]).position;
    ratios.push_back((frame.cam_from_world * point.position).norm() / truth.norm());
  }
  std::nth_element(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2), ratios.end());
  EXPECT_NEAR(ratios[ratios.size() / 2], 1.0, 0.1);
}

// Two views from nearly one place: the points lie on the wall around them.
TEST_F(TrackLinkerTest, WithLittleParallaxThePointsLieOnTheWall) {
  newest_ = colon_.AddKeyframe(&atlas_, map_, colon_.ViewFrom(kStep * (kKnown - 1) + 0.05 * kStep), Sim3());
  ShareSome(80);
  neighbours_.resize(1);
  // Features that no point shows any more.
  const Keyframe& neighbour = atlas_.keyframe(neighbours_[0].keyframe);
  for (std::int32_t i = 0; i < neighbour.features.num; i += 2) {
    const MapPointHandle point = neighbour.points[i];
    if (point && atlas_.FeatureOf(atlas_.point(point), newest_) < 0) atlas_.RemovePoint(point);
  }
  Link();
  SurfaceDepth surface;
  surface.Load(atlas_.keyframe(newest_), atlas_);
  ASSERT_GT(created_.size(), 20u);
  for (const MapPointHandle handle : created_) {
    const MapPoint& point = atlas_.point(handle);
    const Keyframe& keyframe = atlas_.keyframe(newest_);
    double depth = 0.0;
    ASSERT_TRUE(surface.At(keyframe.features.pixel(atlas_.FeatureOf(point, newest_)), &depth));
    EXPECT_NEAR(std::log((keyframe.cam_from_map * point.position).norm() / depth), 0.0, 0.4);
  }
}

TEST_F(TrackLinkerTest, WithoutAWallNoPointsAreMade) {
  Link();
  EXPECT_TRUE(created_.empty());
}

TEST_F(TrackLinkerTest, OffLinksNothing) {
  ShareSome(40);
  colon_.config().mapping.link_neighbours = 0;
  EXPECT_EQ(Link(), 0);
  EXPECT_TRUE(created_.empty());
}

}  // namespace
}  // namespace haustra::test
