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

// What is kept of a keyframe's points goes by their changes: each way to gain or lose one counts.
TEST_F(AtlasTest, GainsAndLossesOfPointsAreChanges) {
  const KeyframeHandle a = Add(map_), b = Add(map_), c = Add(map_);
  const auto num_changes = [&] { return atlas_.keyframe(a).num_point_changes; };
  EXPECT_EQ(num_changes(), 0u);
  const MapPointHandle point = Connect({0, 0, 5}, {{a, 3}, {b, 4}, {c, 5}});
  EXPECT_EQ(num_changes(), 1u);
  EXPECT_TRUE(atlas_.RemoveObservation(point, a));
  EXPECT_EQ(num_changes(), 2u);
  const MapPointHandle other = Connect({0, 1, 5}, {{a, 3}, {b, 6}});
  EXPECT_EQ(num_changes(), 3u);
  atlas_.RemovePoint(other);
  EXPECT_EQ(num_changes(), 4u);
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

// A point among keyframes that are made one after the other, each with one feature for it.
class FullPoint {
 public:
  explicit FullPoint(int max_keyframes) : atlas_({max_keyframes, 10, 1, max_keyframes, 2}) {
    map_ = atlas_.CreateMap();
    point_ = atlas_.AddPoint(map_, Eigen::Vector3d(0, 0, 1), 0);
  }

  KeyframeHandle AddKeyframe(const Eigen::Vector3d& centre, float scale_px) {
    FrameFeatures features(2);
    features.set = {static_cast<std::uint32_t>(keyframes_.size()), 7};
    features.num = 2;
    for (int i = 0; i < 2; ++i) features.keypoints[i].scale_px = scale_px;
    keyframes_.push_back(
        atlas_.AddKeyframe(map_, static_cast<std::uint32_t>(keyframes_.size()), TimePoint{}, At(centre), features));
    return keyframes_.back();
  }
  // The newest keyframe sees the point.
  bool Observe(const Eigen::Vector3d& centre, float scale_px) {
    const bool is_added = atlas_.AddObservation(point_, AddKeyframe(centre, scale_px), 0);
    if (is_added) atlas_.UpdatePoint(point_);
    return is_added;
  }
  bool Sees(int keyframe) const { return atlas_.FeatureOf(point(), keyframes_[keyframe]) >= 0; }
  const MapPoint& point() const { return atlas_.point(point_); }
  MapPointHandle handle() const { return point_; }
  Atlas& atlas() { return atlas_; }
  MapHandle map() const { return map_; }
  KeyframeHandle keyframe(int i) const { return keyframes_[i]; }
  int num_keyframes() const { return static_cast<int>(keyframes_.size()); }

  // Largest angle at the point between two cameras: all that were made, or those that observe it.
  double Span(bool of_all) const {
    double largest = 0.0;
    for (int i = 0; i < num_keyframes(); ++i) {
      for (int j = 0; j < i; ++j) {
        if (of_all || (Sees(i) && Sees(j))) largest = std::max(largest, AngleBetween(i, j));
      }
    }
    return largest;
  }
  double AngleBetween(int i, int j) const { return std::acos(std::min(1.0, Ray(i).dot(Ray(j)))); }
  // Standard deviation of the point's position from the views that `is_used` names, for rays of one sigma each.
  template <typename IsUsed>
  double Sigma(IsUsed&& is_used) const {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    for (int i = 0; i < num_keyframes(); ++i) {
      if (!is_used(i)) continue;
      const Eigen::Vector3d ray = Ray(i);
      const double distance = (Centre(i) - point().position).norm();
      information += (Eigen::Matrix3d::Identity() - ray * ray.transpose()) / (distance * distance);
    }
    return std::sqrt(information.inverse().trace());
  }

 private:
  static SE3 At(const Eigen::Vector3d& centre) { return SE3(Eigen::Quaterniond::Identity(), -centre); }
  Eigen::Vector3d Centre(int i) const { return atlas_.keyframe(keyframes_[i]).cam_from_map.InverseTranslation(); }
  Eigen::Vector3d Ray(int i) const { return (Centre(i) - point().position).normalized(); }

  Atlas atlas_;
  MapHandle map_;
  MapPointHandle point_;
  std::vector<KeyframeHandle> keyframes_;
};

// A scope that hovers, wanders and comes back: whatever its way, every new keyframe observes the point, and what the
// point keeps tells where it is nearly as well as everything it was ever seen in.
TEST(FullPoint, EveryNewKeyframeObservesItAndItsBaselineStays) {
  constexpr int kKeyframes = 200;
  double kept = 0.0, first = 0.0, latest = 0.0;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto draw = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random()) / static_cast<double>(std::mt19937::max());
    };
    FullPoint full(kKeyframes);
    Eigen::Vector3d centre(0, 0, 0);
    for (int i = 0; i < kKeyframes; ++i) {
      // Mostly in small steps about where it is, sometimes on.
      const double step = random() % 8 == 0 ? 0.15 : 0.005;
      centre += step * Eigen::Vector3d(draw(-1, 1), draw(-1, 1), draw(-1, 1));
      centre = centre.cwiseMax(-0.6).cwiseMin(0.6);
      ASSERT_TRUE(full.Observe(centre, static_cast<float>(draw(2, 6)))) << i;
      ASSERT_LE(full.point().observations.size(), static_cast<std::size_t>(kMaxObservations));
      for (int recent = std::max(0, i - 9); recent <= i; ++recent) ASSERT_TRUE(full.Sees(recent)) << i;
    }
    EXPECT_EQ(full.point().observations.size(), static_cast<std::size_t>(kMaxObservations));
    EXPECT_EQ(CheckInvariants(full.atlas()).ToString(), "ok");
    EXPECT_GT(full.Span(false), 0.9 * full.Span(true));
    // Five times as many views are 2.2 times as precise, when the baselines are the same.
    const double of_all = full.Sigma([](int) { return true; });
    const double of_kept = full.Sigma([&](int i) { return full.Sees(i); });
    EXPECT_LT(of_kept, 2.6 * of_all);
    kept += of_kept / of_all;
    first += full.Sigma([](int i) { return i < kMaxObservations; }) / of_all;
    latest += full.Sigma([](int i) { return i >= kKeyframes - kMaxObservations; }) / of_all;
    EXPECT_EQ(full.atlas().num_refused_observations(), 0u);
  }
  // Better than the first or the latest forty.
  EXPECT_LT(kept, 0.8 * first);
  EXPECT_LT(kept, 0.8 * latest);
}

// Search in neighbours offers the same old views again and again. That comes to rest.
TEST(FullPoint, OldViewsOfferedAgainAndAgainComeToRest) {
  FullPoint full(100);
  std::mt19937 random(3);
  for (int i = 0; i < 100; ++i) {
    full.Observe(Eigen::Vector3d(0.01 * (i % 17), 0.02 * (i % 5), 0.002 * (random() % 10)), 3.0f);
  }
  std::vector<bool> seen(100);
  const std::uint64_t refused = full.atlas().num_refused_observations();
  for (int round = 0; round < 4; ++round) {
    for (int i = 0; i < 100; ++i) seen[i] = full.Sees(i);
    for (int i = 0; i < 100; ++i) {
      if (!seen[i]) full.atlas().AddObservation(full.handle(), full.keyframe(i), 0);
    }
  }
  for (int i = 0; i < 100; ++i) EXPECT_EQ(seen[i], full.Sees(i)) << i;
  EXPECT_GT(full.atlas().num_refused_observations(), refused);
  EXPECT_EQ(CheckInvariants(full.atlas()).ToString(), "ok");
}

TEST(FullPoint, OfTwoViewsFromOnePlaceTheCoarserGoes) {
  FullPoint full(kMaxObservations + 1);
  // A fan of views half a degree apart and finer the farther out, but the fourth and fifth from one place.
  for (int i = 0; i <= kMaxObservations; ++i) {
    const double angle = 0.01 * (i == 4 ? 3.02 : i);
    const Eigen::Vector3d centre(std::sin(angle), 0, 1 - std::cos(angle));
    ASSERT_TRUE(full.Observe(centre, i == 3 ? 6.0f : 3.0f));
  }
  for (int i = 0; i <= kMaxObservations; ++i) EXPECT_EQ(full.Sees(i), i != 3) << i;
}

// The descriptor is that of a view that the point still has, or a keyframe that goes would leave it behind.
TEST(FullPoint, DescriptorIsAlwaysThatOfAnObserver) {
  FullPoint full(120);
  std::mt19937 random(9);
  for (int i = 0; i < 120; ++i) {
    const KeyframeHandle keyframe = full.AddKeyframe({0.001 * (random() % 300), 0.001 * (random() % 300), 0}, 3.0f);
    full.atlas().AddObservation(full.handle(), keyframe, 0);  // and no update
    bool is_observer = i == 0;
    for (const Observation& observation : full.point().observations) {
      is_observer |= full.atlas().keyframe(observation.keyframe).features.set == full.point().descriptor.set;
    }
    if (i >= kMaxObservations) {
      EXPECT_TRUE(is_observer) << i;
    }
  }
}

TEST(FullPoint, FusedPointsShareTheList) {
  FullPoint full(kMaxObservations + 2);
  for (int i = 0; i < kMaxObservations; ++i) ASSERT_TRUE(full.Observe({0.01 * i, 0, 0}, 3.0f));
  const MapPointHandle other = full.atlas().AddPoint(full.map(), {0, 0, 1}, 0);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(full.atlas().AddObservation(other, full.AddKeyframe({0, 0.3, 0}, 3.0f), 1));
  full.atlas().FusePoints(other, full.handle());
  EXPECT_EQ(full.point().observations.size(), static_cast<std::size_t>(kMaxObservations));
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(full.Sees(kMaxObservations + i));
  EXPECT_EQ(CheckInvariants(full.atlas()).ToString(), "ok");
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

TEST_F(AtlasTest, PointsOfTheLocalMapAreEstablishedWithTheThirdKeyframe) {
  std::vector<KeyframeHandle> all;
  for (const int second : {7, 3, 9, 5}) {
    all.push_back(Add(map_));
    atlas_.keyframe(all.back()).timestamp = TimePoint(std::chrono::seconds(second));
  }
  const MapPointHandle of_all = Connect({0, 0, 5}, {{all[0], 1}, {all[1], 1}, {all[2], 1}, {all[3], 1}});
  const MapPointHandle of_two = Connect({0, 0, 6}, {{all[0], 2}, {all[1], 2}});
  LocalMapBuilder builder(16, 200);
  LocalMap local(50);
  builder.Build(atlas_, all[0], &local);
  EXPECT_EQ(local.points[local.Find(of_all)].established, TimePoint(std::chrono::seconds(7)));
  EXPECT_EQ(local.points[local.Find(of_two)].established, TimePoint::max());
}

TEST_F(AtlasTest, PointsOfALocalMapOfTwoKeyframesAreEstablishedWithTheSecond) {
  std::vector<KeyframeHandle> both;
  for (const int second : {7, 3}) {
    both.push_back(Add(map_));
    atlas_.keyframe(both.back()).timestamp = TimePoint(std::chrono::seconds(second));
  }
  const MapPointHandle point = Connect({0, 0, 5}, {{both[0], 1}, {both[1], 1}});
  LocalMapBuilder builder(16, 200);
  LocalMap local(50);
  builder.Build(atlas_, both[0], &local);
  ASSERT_TRUE(local.is_established(local.points[local.Find(point)]));
  EXPECT_EQ(local.points[local.Find(point)].established, TimePoint(std::chrono::seconds(7)));
}

TEST(LocalMapBuilder, WhatAnEarlierSessionSawIsEstablishedFromTheStart) {
  Atlas atlas({3, 4, 1, 4, kFeatures});
  atlas.RestoreCounters({3, 1, 1, 1, 0});
  const MapHandle map = atlas.RestoreMap(0);
  FrameFeatures features(kFeatures);
  features.num = kFeatures;
  std::vector<KeyframeHandle> all;
  for (KeyframeId id = 0; id < 3; ++id) {
    const TimePoint then(std::chrono::hours(id + 1));
    all.push_back(atlas.RestoreKeyframe(map, id, 0, id, then, SE3{}, 1.0, features));
  }
  const MapPointHandle point = atlas.RestorePoint(map, 0, {0, 0, 5}, 0);
  for (const KeyframeHandle keyframe : all) ASSERT_TRUE(atlas.AddObservation(point, keyframe, 1));
  atlas.UpdatePoint(point);
  LocalMapBuilder builder(3, 4);
  LocalMap local(4);
  builder.Build(atlas, all[0], &local);
  ASSERT_EQ(local.num_points, 1);
  EXPECT_EQ(local.points[0].established, TimePoint::min());
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
