// Marks in the atlas: whatever happens to keyframes and maps, a mark stays at its place on the wall.
#include "engine/atlas/mark.h"

#include <gtest/gtest.h>

#include <map>

#include "engine/atlas/atlas.h"
#include "engine/atlas/invariants.h"
#include "engine/geometry/rng.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

constexpr int kFeatures = 4;

MarkLabel Label(std::string_view text) { return MarkLabel::From(text).value(); }

class MarkTest : public testing::Test {
 protected:
  MarkTest() : atlas_({40, 10, 8, 400, kFeatures, 3}) {}

  KeyframeHandle AddKeyframe(MapHandle map) {
    FrameFeatures features(kFeatures);
    return atlas_.AddKeyframe(map, num_frames_++, TimePoint{}, RandomPose(rng_, 3.0, 4.0), features);
  }
  MarkHandle AddMark(const char* label, KeyframeHandle keyframe, const Eigen::Vector3d& position) {
    Mark mark;
    mark.label = Label(label);
    mark.frame_index = 7;
    PlacedMark place;
    place.map = atlas_.keyframe(keyframe).map;
    place.position = position;
    place.normal = RandomDirection(rng_);
    place.radius = 0.25;
    return atlas_.AddMark(mark, keyframe, place);
  }
  PlacedMark PlaceOf(MarkHandle mark) const { return atlas_.PlaceOf(atlas_.marks().At(mark)); }

  Rng rng_{3};
  Atlas atlas_;
  std::uint32_t num_frames_ = 0;
};

TEST(MarkLabel, IsShortAndOfPlainLetters) {
  for (const char* good : {"p", "polyp_1", "Polyp-2.a", "0", "1234567890123456789012345678901"}) {
    const auto label = MarkLabel::From(good);
    ASSERT_TRUE(label) << good;
    EXPECT_EQ(label->view(), good);
  }
  for (const char* bad : {"", " p", "p 1", "-p", "p,q", "p\"", "\xc3\xa4", "12345678901234567890123456789012"}) {
    EXPECT_FALSE(MarkLabel::From(bad)) << bad;
  }
}

TEST_F(MarkTest, MarkIsWhereItWasSet) {
  const MapHandle map = atlas_.CreateMap();
  const MarkHandle mark = AddMark("a", AddKeyframe(map), {1.0, -2.0, 3.0});
  ASSERT_TRUE(mark);
  EXPECT_LT((PlaceOf(mark).position - Eigen::Vector3d(1.0, -2.0, 3.0)).norm(), 1e-12);
  EXPECT_EQ(PlaceOf(mark).map, map);
  EXPECT_EQ(atlas_.FindMark("a"), mark);
  EXPECT_FALSE(atlas_.FindMark("b").is_valid());
  EXPECT_TRUE(atlas_.HasMarks(map));
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

TEST_F(MarkTest, FullPoolRefusesAndKeepsWhatIsThere) {
  const KeyframeHandle keyframe = AddKeyframe(atlas_.CreateMap());
  for (const char* label : {"a", "b", "c"}) EXPECT_TRUE(AddMark(label, keyframe, Eigen::Vector3d::UnitZ()));
  EXPECT_FALSE(AddMark("d", keyframe, Eigen::Vector3d::UnitZ()));
  for (const char* label : {"a", "b", "c"}) EXPECT_TRUE(atlas_.FindMark(label)) << label;
  const MarkId last = atlas_.marks().At(atlas_.FindMark("c")).id;
  atlas_.RemoveMark(atlas_.FindMark("b"));
  const MarkHandle next = AddMark("d", keyframe, Eigen::Vector3d::UnitZ());
  ASSERT_TRUE(next);
  EXPECT_GT(atlas_.marks().At(next).id, last);  // no id comes twice
}

TEST_F(MarkTest, MarkMovesWithItsKeyframe) {
  const KeyframeHandle keyframe = AddKeyframe(atlas_.CreateMap());
  const MarkHandle mark = AddMark("a", keyframe, {1.0, -2.0, 3.0});
  const SE3 old_pose = atlas_.keyframe(keyframe).cam_from_map;
  const SE3 new_pose = RandomPose(rng_, 1.0, 1.0);
  atlas_.CorrectKeyframe(keyframe, new_pose, 1.5);
  const Eigen::Vector3d in_camera = old_pose * Eigen::Vector3d(1.0, -2.0, 3.0);
  EXPECT_LT((new_pose * PlaceOf(mark).position - 1.5 * in_camera).norm(), 1e-9);
  EXPECT_NEAR(PlaceOf(mark).radius, 1.5 * 0.25, 1e-12);
}

// Keyframes go and maps are moved, change their unit and are joined, in any order: the place of each mark in the world
// stays what it was.
TEST_F(MarkTest, AnyHistoryLeavesAMarkAtItsPlace) {
  for (int trial = 0; trial < Trials(60); ++trial) {
    atlas_ = Atlas({40, 10, 8, 400, kFeatures, 3});
    std::map<MapHandle, Sim3> map_from_world;
    std::vector<MapHandle> maps;
    std::vector<KeyframeHandle> keyframes;
    for (int i = 0; i < 3; ++i) {
      maps.push_back(atlas_.CreateMap());
      map_from_world[maps.back()] = Sim3();
      for (int k = 0; k < 5; ++k) keyframes.push_back(AddKeyframe(maps.back()));
    }
    std::map<MarkHandle, std::pair<Eigen::Vector3d, Eigen::Vector3d>> in_world;
    const char* labels[] = {"a", "b", "c"};
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d position = rng_.Uniform(1.0, 4.0) * RandomDirection(rng_);
      const auto at = static_cast<std::size_t>(rng_.Uniform(0.0, 15.0));
      const MarkHandle mark = AddMark(labels[i], keyframes[at], position);
      in_world[mark] = {position, PlaceOf(mark).normal};
    }
    for (int step = 0; step < 12; ++step) {
      const MapHandle map = maps[static_cast<std::size_t>(rng_.Uniform(0.0, static_cast<double>(maps.size())))];
      const auto& all = atlas_.map(map).keyframes;
      if (rng_.Uniform() < 0.5 && all.size() > 1) {
        const auto gone = static_cast<std::size_t>(rng_.Uniform(0.0, static_cast<double>(all.size())));
        atlas_.RemoveKeyframe(all[gone], all[gone == 0 ? 1 : gone - 1]);
      } else if (rng_.Uniform() < 0.7 || maps.size() == 1) {
        const Sim3 new_from_old(rng_.Uniform(0.5, 2.0), RandomRotation(rng_, 3.0), RandomDirection(rng_));
        atlas_.TransformMap(map, new_from_old);
        map_from_world[map] = new_from_old * map_from_world[map];
      } else {
        const MapHandle from = maps.front() == map ? maps.back() : maps.front();
        const Sim3 into_from = map_from_world[map] * map_from_world[from].Inverse();
        atlas_.TransformMap(from, into_from);
        atlas_.AbsorbMap(map, from);
        std::erase(maps, from);
      }
      ASSERT_EQ(CheckInvariants(atlas_).ToString(), "ok") << "trial " << trial << ", step " << step;
    }
    for (const auto& [mark, truth] : in_world) {
      const PlacedMark place = PlaceOf(mark);
      const Sim3& now = map_from_world.at(place.map);
      EXPECT_LT((place.position - now * truth.first).norm(), 1e-7 * now.scale) << "trial " << trial;
      EXPECT_LT((place.normal - now.rotation * truth.second).norm(), 1e-9) << "trial " << trial;
      EXPECT_NEAR(place.radius, 0.25 * now.scale, 1e-9) << "trial " << trial;
    }
  }
}

}  // namespace
}  // namespace haustra::test
