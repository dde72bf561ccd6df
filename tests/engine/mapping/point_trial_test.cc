#include "engine/mapping/point_trial.h"

#include <gtest/gtest.h>

namespace haustra {
namespace {

class PointTrialTest : public testing::Test {
 protected:
  PointTrialTest() : atlas_({64, 100, 4, 100, 40}), trial_(options_) {
    options_.point_trial_keyframes = 3;
    options_.min_lasting_observations = 3;
  }

  KeyframeHandle AddKeyframe(MapHandle map) {
    FrameFeatures features(40);
    features.num = 40;
    for (Keypoint& keypoint : features.keypoints) keypoint.scale_px = 2.0f;
    features.set = {next_++, 7};
    return atlas_.AddKeyframe(map, next_, TimePoint{}, SE3{}, features);
  }
  // As the mapper does it: the keyframe is there, then the trial counts it.
  int Grow(MapHandle map, int num_keyframes) {
    int num_removed = 0;
    for (int i = 0; i < num_keyframes; ++i) {
      AddKeyframe(map);
      num_removed += trial_.CountKeyframe(map, &atlas_);
    }
    return num_removed;
  }
  MapPointHandle MakePoint(MapHandle map, int num_observations) {
    const MapPointHandle point = atlas_.AddPoint(map, {0, 0, 1}, 0);
    for (int i = 0; i < num_observations; ++i) {
      EXPECT_TRUE(atlas_.AddObservation(point, atlas_.map(map).keyframes[static_cast<std::size_t>(i)], num_points_));
    }
    ++num_points_;
    trial_.Begin(map, point);
    return point;
  }
  bool Stands(MapPointHandle point) const { return atlas_.GetPoint(point) != nullptr; }

  MappingConfig options_;
  Atlas atlas_;
  PointTrial trial_;
  std::uint32_t next_ = 0;
  int num_points_ = 0;
};

TEST_F(PointTrialTest, JudgesAfterTheTrialByTheObservations) {
  const MapHandle map = atlas_.CreateMap();
  Grow(map, 4);
  const MapPointHandle poor = MakePoint(map, 2), rich = MakePoint(map, 3);
  EXPECT_EQ(Grow(map, 2), 0);
  EXPECT_TRUE(Stands(poor));
  EXPECT_EQ(Grow(map, 1), 1);
  EXPECT_FALSE(Stands(poor));
  EXPECT_TRUE(Stands(rich));
  EXPECT_EQ(Grow(map, 5), 0);
}

// Tracking is lost, founds another map, and finds its way back: neither does the trial end unheard, nor is it
// forgotten.
TEST_F(PointTrialTest, RestsWhileAnotherMapIsTracked) {
  const MapHandle first = atlas_.CreateMap(), second = atlas_.CreateMap();
  Grow(first, 3);
  const MapPointHandle early = MakePoint(first, 2);
  Grow(first, 1);
  const MapPointHandle late = MakePoint(first, 2);
  Grow(second, 20);
  EXPECT_TRUE(Stands(early));
  EXPECT_EQ(Grow(first, 1), 0);
  EXPECT_EQ(Grow(first, 1), 1);
  EXPECT_FALSE(Stands(early));
  EXPECT_TRUE(Stands(late));
  EXPECT_EQ(Grow(first, 1), 1);
  EXPECT_FALSE(Stands(late));
}

TEST_F(PointTrialTest, GoesOnInTheMapThatTookThePointsOver) {
  const MapHandle into = atlas_.CreateMap(), from = atlas_.CreateMap();
  Grow(into, 2);
  Grow(from, 2);
  const MapPointHandle point = MakePoint(from, 2);
  Grow(from, 1);
  atlas_.AbsorbMap(into, from);
  trial_.Join(into, from);
  EXPECT_EQ(Grow(into, 1), 0);
  EXPECT_EQ(Grow(into, 1), 1);
  EXPECT_FALSE(Stands(point));
}

TEST_F(PointTrialTest, PointsThatWentAndSlotsThatAreUsedAgainDoNoHarm) {
  const MapHandle map = atlas_.CreateMap();
  Grow(map, 3);
  atlas_.RemovePoint(MakePoint(map, 2));
  MakePoint(map, 2);
  std::vector<FeatureSetHandle> sets;
  atlas_.DropMap(map, &sets);
  atlas_.ForgetMap(map);
  const MapHandle again = atlas_.CreateMap();
  ASSERT_EQ(again.index, map.index);
  Grow(again, 3);
  const MapPointHandle point = MakePoint(again, 2);
  EXPECT_EQ(Grow(again, 2), 0);
  EXPECT_TRUE(Stands(point));
  EXPECT_EQ(Grow(again, 1), 1);
}

}  // namespace
}  // namespace haustra
