// Which points go when the pool is full, in atlases that are put together point by point.
#include "engine/mapping/evictor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include "engine/atlas/invariants.h"
#include "engine/geometry/rng.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::Ge;
using ::testing::Le;

constexpr int kFeatures = 640, kPool = 640;
constexpr int kBatch = kPool / 64;  // so many more may go than are wanted

class NoRetrieval final : public KeyframeRetrieval {
 public:
  Status Add(const Atlas&, KeyframeHandle) override { return Status::Ok(); }
  void Remove(KeyframeHandle) override {}
  Status Query(const Atlas&, const RetrievalQuery&, std::vector<RetrievalCandidate>*) override { return Status::Ok(); }
  Status Prepare(const Atlas&, const RetrievalQuery&, VoteList*, std::vector<RetrievalCandidate>*) override {
    return Status::Ok();
  }
};

class EvictorTest : public testing::Test {
 protected:
  EvictorTest()
      : config_(MakeConfig()),
        atlas_({config_.memory.max_keyframes, kPool, 8, 64, kFeatures, 1}),
        evictor_(
            config_, atlas_, retrieval_, [](FeatureSetHandle) {}, [](MapHandle) {}) {}

  static EngineConfig MakeConfig() {
    EngineConfig config;
    config.features.max = kFeatures;
    config.memory.max_keyframes = 24;
    config.memory.max_map_points = kPool;
    config.memory.small_map_keyframes = 0;
    return config;
  }
  KeyframeHandle AddKeyframe(MapHandle map) {
    FrameFeatures features(kFeatures);
    features.num = kFeatures;
    return atlas_.AddKeyframe(map, num_frames_++, TimePoint{}, SE3{}, features);
  }
  std::vector<KeyframeHandle> AddKeyframes(MapHandle map, int count) {
    std::vector<KeyframeHandle> keyframes;
    for (int i = 0; i < count; ++i) keyframes.push_back(AddKeyframe(map));
    return keyframes;
  }
  // So many points that all of these keyframes see.
  std::vector<MapPointHandle> AddPoints(const std::vector<KeyframeHandle>& seen_by, int count) {
    std::vector<MapPointHandle> points;
    for (int i = 0; i < count; ++i) {
      const MapHandle map = atlas_.keyframe(seen_by[0]).map;
      const MapPointHandle point = atlas_.AddPoint(map, Eigen::Vector3d::UnitZ(), 0);
      for (const KeyframeHandle keyframe : seen_by) {
        EXPECT_TRUE(atlas_.AddObservation(point, keyframe, atlas_.keyframe(keyframe).num_points));
      }
      points.push_back(point);
    }
    return points;
  }
  int NumLeft(const std::vector<MapPointHandle>& points) const {
    return static_cast<int>(
        std::count_if(points.begin(), points.end(), [&](MapPointHandle p) { return atlas_.GetPoint(p) != nullptr; }));
  }

  EngineConfig config_;
  Atlas atlas_;
  NoRetrieval retrieval_;
  Evictor evictor_;
  std::uint32_t num_frames_ = 0;
};

// The scope goes on where everything known is well known.
TEST_F(EvictorTest, AMapOfEstablishedPointsMakesRoomForNewOnes) {
  const MapHandle map = atlas_.CreateMap();
  const auto old = AddKeyframes(map, 4), older = AddKeyframes(map, 4), here = AddKeyframes(map, 4);
  const auto of_old = AddPoints(old, 200), of_older = AddPoints(older, 200), near = AddPoints(here, 240);
  ASSERT_EQ(atlas_.points().size(), atlas_.points().capacity());
  EXPECT_TRUE(evictor_.MakePointRoom(100, here.back()));
  EXPECT_GE(atlas_.points().capacity() - atlas_.points().size(), 100u);
  EXPECT_EQ(NumLeft(near), 240);
  EXPECT_EQ(evictor_.counters().num_points, atlas_.points().capacity() - atlas_.points().size());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  // Both places can be found again.
  EXPECT_GT(NumLeft(of_old), 120);
  EXPECT_GT(NumLeft(of_older), 120);
}

TEST_F(EvictorTest, PointsThatFewSeeGoFirst) {
  const MapHandle map = atlas_.CreateMap();
  const auto there = AddKeyframes(map, 3), here = AddKeyframes(map, 2);
  const auto by_all = AddPoints(there, 200), by_two = AddPoints({there[0], there[1]}, 200);
  AddPoints(here, 240);
  EXPECT_TRUE(evictor_.MakePointRoom(100, here.back()));
  EXPECT_EQ(NumLeft(by_all), 200);
  EXPECT_THAT(NumLeft(by_two), AllOf(Ge(100 - kBatch), Le(100)));
}

// Made first, the points of the thin place have the lowest slots.
TEST_F(EvictorTest, APlaceWithFewPointsKeepsThem) {
  const MapHandle map = atlas_.CreateMap();
  const auto thin = AddKeyframes(map, 2), rich = AddKeyframes(map, 2), richer = AddKeyframes(map, 2);
  const auto here = AddKeyframes(map, 2);
  const auto few = AddPoints(thin, 60), many = AddPoints(rich, 190), more = AddPoints(richer, 220);
  AddPoints(here, kPool - static_cast<int>(atlas_.points().size()));
  EXPECT_TRUE(evictor_.MakePointRoom(120, here.back()));
  EXPECT_EQ(NumLeft(few), 60);
  EXPECT_LT(std::abs(NumLeft(many) - NumLeft(more)), 20);
}

// A place that a few points hold gives them last, even where nobody else sees them.
TEST_F(EvictorTest, NoPlaceIsEmptiedWhileOthersHaveMore) {
  const MapHandle map = atlas_.CreateMap();
  const auto thin = AddKeyframes(map, 2), rich = AddKeyframes(map, 4), here = AddKeyframes(map, 2);
  const auto few = AddPoints(thin, 20), many = AddPoints(rich, 380);
  AddPoints(here, 240);
  EXPECT_TRUE(evictor_.MakePointRoom(150, here.back()));
  EXPECT_EQ(NumLeft(few), 20);
  EXPECT_THAT(NumLeft(many), AllOf(Ge(230 - kBatch), Le(230)));
}

TEST_F(EvictorTest, OtherMapsGiveBeforeTheActiveOne) {
  const MapHandle stored = atlas_.CreateMap();
  const auto there = AddKeyframes(stored, 6);
  const auto of_stored = AddPoints(there, 200);
  atlas_.map(stored).status = MapStatus::kStored;
  const MapHandle map = atlas_.CreateMap();
  const auto far = AddKeyframes(map, 4), here = AddKeyframes(map, 4);
  const auto of_active = AddPoints(far, 200);
  AddPoints(here, 240);
  EXPECT_TRUE(evictor_.MakePointRoom(100, here.back()));
  EXPECT_EQ(NumLeft(of_active), 200);
  EXPECT_THAT(NumLeft(of_stored), AllOf(Ge(100 - kBatch), Le(100)));
}

// Everything is around the tracker: nothing may go.
TEST_F(EvictorTest, TheTrackersSurroundingsStay) {
  const MapHandle map = atlas_.CreateMap();
  const auto here = AddKeyframes(map, 12);
  for (int i = 0; i + 1 < 12; ++i) AddPoints({here[i], here[i + 1]}, 50);
  AddPoints(here, 90);  // all are covisible
  EXPECT_EQ(atlas_.points().size(), atlas_.points().capacity());
  EXPECT_FALSE(evictor_.MakePointRoom(10, here.back()));
  EXPECT_EQ(atlas_.points().size(), atlas_.points().capacity());
}

// A doctor's mark keeps its map, however small, and goes over to a keyframe that stays.
TEST_F(EvictorTest, MapWithAMarkStays) {
  const MapHandle marked = atlas_.CreateMap();
  const auto there = AddKeyframes(marked, 6);
  atlas_.map(marked).status = MapStatus::kStored;
  const MapHandle other = atlas_.CreateMap();
  AddKeyframes(other, 8);
  atlas_.map(other).status = MapStatus::kStored;
  const MapHandle map = atlas_.CreateMap();
  const auto here = AddKeyframes(map, 10);
  Mark mark;
  mark.label = MarkLabel::From("polyp").value();
  ASSERT_TRUE(atlas_.AddMark(mark, there[2], {marked, {0.0, 0.0, 2.0}, {0.0, 0.0, -1.0}, 0.1}));
  config_.memory.small_map_keyframes = 8;
  config_.mapping.min_map_keyframes = 6;
  EXPECT_TRUE(evictor_.MakeKeyframeRoom(8, here.back()));
  EXPECT_EQ(atlas_.map(marked).status, MapStatus::kStored);
  EXPECT_EQ(atlas_.map(other).status, MapStatus::kDropped);
  config_.mapping.min_map_keyframes = 2;
  EXPECT_TRUE(evictor_.MakeKeyframeRoom(12, here.back()));
  EXPECT_EQ(atlas_.marks().size(), 1u);
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

// A founding relies on it: what is said of the room for a new map holds when the active map has been put away as
// Mapper::RetireActiveMap does. Any maps, full pools.
TEST(EvictorRoom, OfAnyMapsIsThereWhereItIsSaidToBe) {
  std::array<int, 2> num_said{};
  int num_overlooked = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed, 1);
    EngineConfig config;
    config.mapping.min_map_keyframes = 2 + static_cast<int>(rng.UniformInt(4));
    config.memory.small_map_keyframes = static_cast<int>(rng.UniformInt(9));
    const int num_maps = 1 + static_cast<int>(rng.UniformInt(4));
    std::vector<int> sizes;
    for (int i = 0; i < num_maps; ++i) sizes.push_back(1 + static_cast<int>(rng.UniformInt(9)));
    config.memory.max_keyframes = std::accumulate(sizes.begin(), sizes.end(), static_cast<int>(rng.UniformInt(2)));
    Atlas atlas({config.memory.max_keyframes, 16, num_maps, 1000, 16, num_maps});
    NoRetrieval retrieval;
    Evictor evictor(
        config, atlas, retrieval, [](FeatureSetHandle) {}, [](MapHandle) {});
    MapHandle active;
    for (int i = 0; i < num_maps; ++i) {
      if (active) atlas.map(active).status = MapStatus::kStored;
      active = atlas.CreateMap();
      KeyframeHandle keyframe;
      for (int k = 0; k < sizes[i]; ++k) {
        keyframe = atlas.AddKeyframe(active, static_cast<std::uint32_t>(k), TimePoint{}, SE3{}, FrameFeatures(16));
      }
      if (rng.UniformInt(2) == 0) continue;
      Mark mark;
      mark.label = MarkLabel::From("polyp-" + std::to_string(i)).value();
      ASSERT_TRUE(atlas.AddMark(mark, keyframe, {active, {0.0, 0.0, 2.0}, {0.0, 0.0, -1.0}, 0.1}));
    }
    const bool has_keyframe_room = evictor.HasKeyframeRoom(2), has_map_room = evictor.HasMapRoom();
    ++num_said[has_keyframe_room ? 1 : 0];
    if (sizes.back() >= config.mapping.min_map_keyframes || atlas.HasMarks(active)) {
      atlas.map(active).status = MapStatus::kStored;
    } else {
      std::vector<FeatureSetHandle> sets;
      atlas.DropMap(active, &sets);
    }
    const bool is_made = evictor.MakeKeyframeRoom(2, {});
    if (has_keyframe_room) {
      EXPECT_TRUE(is_made);
    }
    num_overlooked += is_made && !has_keyframe_room;
    EXPECT_EQ(evictor.MakeMapRoom(), has_map_room);
  }
  EXPECT_LE(num_overlooked, 4);
  EXPECT_GT(num_said[0], 20);
  EXPECT_GT(num_said[1], 20);
}

// One map: keyframes down to the least of a map, or all when it is small and has no mark; and ids for them.
TEST(EvictorRoom, IsThereWhereItCanBeMade) {
  for (const bool is_marked : {false, true}) {
    for (const int num_keyframes : {4, 5, 6, 8, 9}) {
      SCOPED_TRACE(num_keyframes);
      EngineConfig config;
      config.memory.max_keyframes = num_keyframes;
      config.memory.small_map_keyframes = 8;
      config.mapping.min_map_keyframes = 4;
      Atlas atlas({num_keyframes, 16, 1, 64, 16, 1});
      NoRetrieval retrieval;
      Evictor evictor(
          config, atlas, retrieval, [](FeatureSetHandle) {}, [](MapHandle) {});
      const MapHandle map = atlas.CreateMap();
      KeyframeHandle keyframe;
      for (int i = 0; i < num_keyframes; ++i) {
        keyframe = atlas.AddKeyframe(map, static_cast<std::uint32_t>(i), TimePoint{}, SE3{}, FrameFeatures(16));
      }
      Mark mark;
      mark.label = MarkLabel::From("polyp").value();
      if (is_marked) {
        ASSERT_TRUE(atlas.AddMark(mark, keyframe, {map, {0.0, 0.0, 2.0}, {0.0, 0.0, -1.0}, 0.1}));
      }
      const bool has_keyframe_room = evictor.HasKeyframeRoom(2), has_map_room = evictor.HasMapRoom();
      EXPECT_FALSE(evictor.HasKeyframeRoom(64 - num_keyframes + 1)) << "there are no ids for them";
      EXPECT_EQ(atlas.keyframes().size(), static_cast<std::uint32_t>(num_keyframes)) << "nothing goes";
      EXPECT_EQ(has_keyframe_room, !is_marked || num_keyframes >= 6);
      EXPECT_EQ(has_map_room, !is_marked);
      atlas.map(map).status = MapStatus::kStored;
      EXPECT_EQ(evictor.MakeKeyframeRoom(2, {}), has_keyframe_room);
      EXPECT_EQ(evictor.MakeMapRoom(), has_map_room);
    }
  }
}

}  // namespace
}  // namespace haustra
