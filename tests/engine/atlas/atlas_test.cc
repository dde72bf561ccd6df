// The atlas after single operations with known outcome, and after long random sequences of them.
#include "engine/atlas/atlas.h"

#include <gtest/gtest.h>

#include <random>

#include "engine/atlas/invariants.h"
#include "engine/atlas/local_map.h"

namespace haustra {
namespace {

constexpr int kFeatures = 40;

class AtlasTest : public testing::Test {
 protected:
  AtlasTest() : atlas_({16, 200, 4, 100, kFeatures}) { map_ = atlas_.CreateMap(); }

  KeyframeHandle Add(MapHandle map, const SE3& cam_from_map = SE3{}) {
    FrameFeatures features(kFeatures);
    features.set = {next_set_++, 7};
    features.num = kFeatures;
    for (int i = 0; i < kFeatures; ++i) features.keypoints[i].scale_px = 2.0f;
    const KeyframeHandle handle = atlas_.AddKeyframe(map, next_frame_++, TimePoint{}, cam_from_map, features);
    return handle;
  }

  MapPointHandle Connect(const Eigen::Vector3d& position, std::initializer_list<std::pair<KeyframeHandle, int>> views) {
    const MapPointHandle point = atlas_.AddPoint(map_, position, 0);
    for (const auto& [keyframe, feature] : views) EXPECT_TRUE(atlas_.AddObservation(point, keyframe, feature));
    atlas_.UpdatePoint(point);
    return point;
  }

  Atlas atlas_;
  MapHandle map_;
  std::uint32_t next_set_ = 0;
  std::uint32_t next_frame_ = 0;
};

SE3 At(double x, double y, double z) { return SE3(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-x, -y, -z)); }

TEST_F(AtlasTest, ObservationConnectsBothDirections) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_, At(1, 0, 0));
  const MapPointHandle point = Connect({0, 0, 5}, {{a, 3}, {b, 4}});
  EXPECT_EQ(atlas_.keyframe(a).points[3], point);
  EXPECT_EQ(atlas_.FeatureOf(atlas_.point(point), b), 4);
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

TEST_F(AtlasTest, SecondObservationInOneKeyframeIsRefused) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_);
  const MapPointHandle point = Connect({0, 0, 5}, {{a, 3}, {b, 4}});
  EXPECT_FALSE(atlas_.AddObservation(point, a, 5));
  const MapPointHandle other = Connect({0, 1, 5}, {{a, 6}, {b, 7}});
  EXPECT_FALSE(atlas_.AddObservation(other, a, 3));
}

TEST_F(AtlasTest, PointWithOneObservationLeftIsRemoved) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_);
  const MapPointHandle point = Connect({0, 0, 5}, {{a, 3}, {b, 4}});
  EXPECT_FALSE(atlas_.RemoveObservation(point, a));
  EXPECT_EQ(atlas_.GetPoint(point), nullptr);
  EXPECT_FALSE(atlas_.keyframe(b).points[4].is_valid());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

TEST_F(AtlasTest, FullListOfObservationsRefusesFurtherOnesAndCountsThem) {
  Atlas atlas({kMaxObservations + 2, 10, 1, 100, kFeatures});
  const MapHandle map = atlas.CreateMap();
  FrameFeatures features(kFeatures);
  features.num = kFeatures;
  std::vector<KeyframeHandle> keyframes;
  for (std::uint32_t i = 0; i < kMaxObservations + 2; ++i) {
    features.set = {i, 7};
    keyframes.push_back(atlas.AddKeyframe(map, i, TimePoint{}, SE3{}, features));
  }
  const MapPointHandle point = atlas.AddPoint(map, {0, 0, 5}, 0);
  for (int i = 0; i < kMaxObservations; ++i) EXPECT_TRUE(atlas.AddObservation(point, keyframes[i], 3)) << i;
  EXPECT_EQ(atlas.num_refused_observations(), 0u);
  EXPECT_FALSE(atlas.AddObservation(point, keyframes[kMaxObservations], 3));
  EXPECT_EQ(atlas.num_refused_observations(), 1u);
  // The keyframe knows nothing of it, and its feature is free for another point.
  EXPECT_FALSE(atlas.keyframe(keyframes[kMaxObservations]).points[3].is_valid());
  // Points that are fused share the list: the other's observations beyond it are refused, too.
  const MapPointHandle other = atlas.AddPoint(map, {0, 0, 5}, 0);
  EXPECT_TRUE(atlas.AddObservation(other, keyframes[kMaxObservations], 3));
  EXPECT_TRUE(atlas.AddObservation(other, keyframes[kMaxObservations + 1], 3));
  atlas.FusePoints(other, point);
  EXPECT_EQ(atlas.num_refused_observations(), 3u);
  EXPECT_EQ(atlas.point(point).observations.size(), static_cast<std::size_t>(kMaxObservations));
  EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");
  // One that goes makes room.
  EXPECT_TRUE(atlas.RemoveObservation(point, keyframes[0]));
  EXPECT_TRUE(atlas.AddObservation(point, keyframes[kMaxObservations], 3));
  EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");
}

TEST_F(AtlasTest, FusedPointHasTheObservationsOfBoth) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_);
  const KeyframeHandle c = Add(map_);
  const KeyframeHandle d = Add(map_);
  const MapPointHandle left = Connect({0, 0, 5}, {{a, 1}, {b, 1}});
  const MapPointHandle right = Connect({0, 0, 5}, {{b, 2}, {c, 2}, {d, 2}});
  atlas_.FusePoints(left, right);
  EXPECT_EQ(atlas_.GetPoint(left), nullptr);
  EXPECT_EQ(atlas_.point(right).observations.size(), 4u);
  EXPECT_EQ(atlas_.FeatureOf(atlas_.point(right), b), 2);  // b keeps the one that it had
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

TEST_F(AtlasTest, CovisibilityCountsSharedPointsMostFirst) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_);
  const KeyframeHandle c = Add(map_);
  Connect({0, 0, 5}, {{a, 1}, {b, 1}, {c, 1}});
  Connect({0, 1, 5}, {{a, 2}, {c, 2}});
  std::vector<Covisible> covisible;
  atlas_.FindCovisible(a, 1, &covisible);
  ASSERT_EQ(covisible.size(), 2u);
  EXPECT_EQ(covisible[0].keyframe, c);
  EXPECT_EQ(covisible[0].num_shared, 2);
  EXPECT_EQ(covisible[1].num_shared, 1);
  atlas_.FindCovisible(a, 2, &covisible);
  EXPECT_EQ(covisible.size(), 1u);
}

TEST_F(AtlasTest, FrameOfCulledKeyframeIsResolvedThroughItsStandIn) {
  const KeyframeHandle a = Add(map_, At(1, 0, 0));
  const KeyframeHandle b = Add(map_, At(2, 0, 0));
  const KeyframeId id_b = atlas_.keyframe(b).id;
  Connect({0, 0, 5}, {{a, 1}, {b, 1}});
  Connect({0, 1, 5}, {{a, 2}, {b, 2}});
  const SE3 cam_from_b = At(0.5, 0, 0);  // frame at x = 2.5
  atlas_.RemoveKeyframe(b, a);
  ResolvedPose pose;
  ASSERT_TRUE(atlas_.Resolve(id_b, cam_from_b, 1.0, &pose));
  EXPECT_NEAR(pose.cam_from_map.InverseTranslation().x(), 2.5, 1e-12);
  // The map moves and doubles its unit: so does everything that hangs on it.
  atlas_.TransformMap(map_, Sim3(2.0, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 1)));
  ASSERT_TRUE(atlas_.Resolve(id_b, cam_from_b, 1.0, &pose));
  EXPECT_NEAR(pose.cam_from_map.InverseTranslation().x(), 5.0, 1e-12);
  EXPECT_NEAR(pose.cam_from_map.InverseTranslation().z(), 1.0, 1e-12);
}

TEST_F(AtlasTest, FrameOfDroppedMapIsNotResolved) {
  const KeyframeHandle a = Add(map_);
  const KeyframeId id = atlas_.keyframe(a).id;
  std::vector<FeatureSetHandle> released;
  atlas_.DropMap(map_, &released);
  ResolvedPose pose;
  EXPECT_FALSE(atlas_.Resolve(id, SE3{}, 1.0, &pose));
  EXPECT_EQ(released.size(), 1u);
  EXPECT_EQ(atlas_.keyframes().size(), 0u);
}

TEST_F(AtlasTest, FullKeyframePoolRefusesWithInvalidHandle) {
  for (int i = 0; i < 16; ++i) EXPECT_TRUE(Add(map_).is_valid());
  EXPECT_FALSE(Add(map_).is_valid());
  EXPECT_EQ(atlas_.keyframes().num_refused(), 1u);
}

TEST_F(AtlasTest, TransformedMapProjectsAsBefore) {
  const KeyframeHandle a = Add(map_, SE3::Exp((Vector6d() << 0.3, -0.2, 0.1, 0.2, -0.1, 0.3).finished()));
  const KeyframeHandle b = Add(map_);
  const MapPointHandle point = Connect({0.4, -0.3, 5}, {{a, 1}, {b, 1}});
  const Eigen::Vector3d before = (atlas_.keyframe(a).cam_from_map * atlas_.point(point).position).normalized();
  atlas_.TransformMap(map_, Sim3(0.37, ExpSO3({0.5, 0.6, -0.7}), {3, -2, 1}));
  const Eigen::Vector3d after = (atlas_.keyframe(a).cam_from_map * atlas_.point(point).position).normalized();
  EXPECT_LT((before - after).norm(), 1e-12);
}

TEST_F(AtlasTest, InvariantsHoldAfterRandomOperations) {
  std::mt19937 random(5);
  const auto draw = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  std::vector<KeyframeHandle> keyframes;
  std::vector<MapPointHandle> points;
  for (int step = 0; step < 5000; ++step) {
    std::erase_if(points, [&](MapPointHandle p) { return atlas_.GetPoint(p) == nullptr; });
    switch (draw(8)) {
      case 0:
        if (keyframes.size() < 12 && atlas_.num_keyframe_ids() < 100) keyframes.push_back(Add(map_, At(draw(9), 0, 0)));
        break;
      case 1:
        if (keyframes.size() > 4) {
          const int i = draw(static_cast<int>(keyframes.size()));
          const KeyframeHandle gone = keyframes[i];
          keyframes.erase(keyframes.begin() + i);
          atlas_.RemoveKeyframe(gone, keyframes.front());
        }
        break;
      case 2:
        if (!points.empty()) atlas_.RemovePoint(points[draw(static_cast<int>(points.size()))]);
        break;
      case 3:
        if (points.size() > 2) {
          const int i = draw(static_cast<int>(points.size()));
          const int j = draw(static_cast<int>(points.size()));
          if (i != j) atlas_.FusePoints(points[i], points[j]);
        }
        break;
      case 4:
        if (!points.empty() && !keyframes.empty()) {
          const MapPointHandle p = points[draw(static_cast<int>(points.size()))];
          atlas_.AddObservation(p, keyframes[draw(static_cast<int>(keyframes.size()))], draw(kFeatures));
          atlas_.UpdatePoint(p);
        }
        break;
      default:
        if (keyframes.size() >= 2 && points.size() < 150) {
          const int k = draw(static_cast<int>(keyframes.size()) - 1);
          const int f = draw(kFeatures);
          const int g = draw(kFeatures);
          if (atlas_.keyframe(keyframes[k]).points[f] || atlas_.keyframe(keyframes[k + 1]).points[g]) break;
          points.push_back(Connect({double(draw(9)), 0, 5}, {{keyframes[k], f}, {keyframes[k + 1], g}}));
        }
    }
    if (step % 50 == 0) {
      ASSERT_EQ(CheckInvariants(atlas_).ToString(), "ok") << "step " << step;
    }
  }
}

TEST_F(AtlasTest, BrokenConnectionIsFoundByTheInvariants) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_);
  Connect({0, 0, 5}, {{a, 3}, {b, 4}});
  atlas_.keyframe(a).points[3] = MapPointHandle{};
  EXPECT_FALSE(CheckInvariants(atlas_).ok());
}

TEST_F(AtlasTest, LocalMapHoldsWindowAndPointsSortedWithTheirObservers) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_, At(0.1, 0, 0));
  const KeyframeHandle far_away = Add(map_, At(100, 0, 0));
  const KeyframeHandle far_too = Add(map_, At(101, 0, 0));
  const MapPointHandle shared = Connect({0, 0, 5}, {{a, 1}, {b, 1}});
  const MapPointHandle elsewhere = Connect({100, 0, 5}, {{far_away, 1}, {far_too, 1}});
  LocalMapBuilder builder(16, 200);
  LocalMap local(50);
  builder.Build(atlas_, b, &local);
  ASSERT_EQ(local.keyframes.size(), 2u);
  EXPECT_EQ(local.keyframes[0].handle, b);
  ASSERT_EQ(local.num_points, 1);
  EXPECT_EQ(local.Find(shared), 0);
  EXPECT_EQ(local.Find(elsewhere), -1);
  EXPECT_EQ(local.points[0].keyframe_mask, 3u);
}

TEST_F(AtlasTest, LocalMapTakesInKeyframesThatStandNearWithoutSharedPoints) {
  const KeyframeHandle a = Add(map_);
  const KeyframeHandle b = Add(map_, At(0.1, 0, 0));
  const KeyframeHandle old_a = Add(map_, At(0.2, 0, 0));
  const KeyframeHandle old_b = Add(map_, At(0.3, 0, 0));
  Connect({0, 0, 5}, {{a, 1}, {b, 1}});
  const MapPointHandle old_point = Connect({0.2, 0, 5}, {{old_a, 1}, {old_b, 1}});
  LocalMapBuilder builder(16, 200);
  LocalMap local(50);
  builder.Build(atlas_, b, &local);
  EXPECT_EQ(local.keyframes.size(), 4u);
  EXPECT_GE(local.Find(old_point), 0);
}

}  // namespace
}  // namespace haustra
