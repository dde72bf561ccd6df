#include "engine/place/place_recogniser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/place/exhaustive_retrieval.h"
#include "engine/place/place_scout.h"
#include "tests/engine/place/synthetic_colon.h"

namespace haustra::test {
namespace {

class PlaceRecogniserTest : public testing::Test {
 protected:
  PlaceRecogniserTest()
      : colon_(21), atlas_(colon_.MakeAtlas()), task_(colon_.config(), std::pmr::get_default_resource()) {}

  bool Recognise(int frame) {
    ExhaustiveRetrieval retrieval(colon_.config(), colon_.config().place.retrieval, colon_.device());
    for (const SyntheticColon::Frame& other : colon_.frames()) {
      EXPECT_TRUE(retrieval.Add(atlas_, other.keyframe).ok());
    }
    PlaceScout scout(colon_.config(), retrieval);
    PlaceRecogniser recogniser(colon_.config(), colon_.camera(), colon_.scene(), colon_.device());
    bool is_question = scout.Begin(atlas_, colon_.frames()[frame].keyframe, &task_);
    if (is_question && task_.stage == PlaceTask::Stage::kRetrieve) {
      recogniser.Recognise(&task_);
      is_question = scout.GoOn(atlas_, &task_);
    }
    if (is_question) recogniser.Recognise(&task_);
    return task_.is_known;
  }

  int FrameOf(KeyframeHandle keyframe) const {
    const auto& frames = colon_.frames();
    const auto is_it = [&](const SyntheticColon::Frame& frame) { return frame.keyframe == keyframe; };
    return static_cast<int>(std::find_if(frames.begin(), frames.end(), is_it) - frames.begin());
  }
  // One map that holds a stretch of wall twice, the second time with some drift. The range of the first eight
  // keyframes; eight more follow, and share no point with them.
  std::pair<int, int> MapTwice() {
    colon_.AddWall(0.0, 7.0, 2500);
    const auto range = colon_.AddMap(&atlas_, 1.6, 2.4, 8, Sim3{});
    const MapHandle map = atlas_.keyframe(colon_.frames()[range.first].keyframe).map;
    const Sim3 drifted_from_world{1.01, ExpSO3({0.02, -0.03, 0.04}), {0.04, -0.03, 0.05}};
    for (int i = 0; i < 8; ++i) {
      colon_.AddKeyframe(&atlas_, map, colon_.ViewFrom(1.6 + 0.1 * i), drifted_from_world);
    }
    colon_.AddPoints(&atlas_, range.second, range.second + 8, 0.0, [](int, int) { return 1; });
    return range;
  }
  // So many features of `frame` show points of `other` from now on.
  void TakePointsOf(int other, int num, int frame) {
    const SyntheticColon::Frame& from = colon_.frames()[other];
    const SyntheticColon::Frame& to = colon_.frames()[frame];
    for (std::size_t i = 0; i < to.landmarks.size() && num > 0; ++i) {
      const auto seen = std::find(from.landmarks.begin(), from.landmarks.end(), to.landmarks[i]);
      if (seen == from.landmarks.end()) continue;
      const MapPointHandle point = atlas_.keyframe(from.keyframe).points[seen - from.landmarks.begin()];
      if (!point) continue;
      const MapPointHandle own = atlas_.keyframe(to.keyframe).points[i];
      if (own) atlas_.RemoveObservation(own, to.keyframe);
      atlas_.AddObservation(point, to.keyframe, static_cast<std::int32_t>(i));
      atlas_.UpdatePoint(point);
      --num;
    }
    ASSERT_EQ(num, 0);
  }

  SyntheticColon colon_;
  Atlas atlas_;
  PlaceTask task_;
  const Sim3 map_from_world_{0.6, ExpSO3({-0.2, 0.7, 1.1}), {1.0, 3.0, -2.0}};
};

TEST_F(PlaceRecogniserTest, FindsTheMapThatShowsTheSameWall) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, map_from_world_).first;
  ASSERT_TRUE(Recognise(first + 2));
  EXPECT_EQ(task_.area.counts.map_b, 0u);
  EXPECT_EQ(task_.area.counts.map_a, 1u);
  EXPECT_GE(task_.area.counts.num_votes, colon_.config().place.retrieval.min_votes);
  ASSERT_FALSE(task_.report.tried.empty());
  EXPECT_EQ(ToString(task_.report.tried.back().verdict), "accepted");
}

TEST_F(PlaceRecogniserTest, KeyframesThatAreConnectedAlreadyAreNoNews) {
  colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  // Those that share little with it are asked, and know nothing new.
  EXPECT_FALSE(Recognise(6));
  EXPECT_FALSE(task_.report.tried.empty());
  for (const CommonAreaCounts& tried : task_.report.tried) EXPECT_EQ(ToString(tried.verdict), "few_matches");
  colon_.config().place.recognition.max_shared_share = 0.0;
  EXPECT_FALSE(Recognise(6));
  EXPECT_EQ(task_.report.num_candidates, 0);
  EXPECT_TRUE(task_.report.tried.empty());
}

// The scope was lost, was found again by one view, and mapped the wall a second time beside the first, with some drift.
TEST_F(PlaceRecogniserTest, APlaceThatANeighbourIsTiedToIsAsked) {
  const auto [first, end] = MapTwice();
  const int before = first + 4, found = end + 2, asked = end + 5;
  TakePointsOf(before, 150, found);
  std::vector<Covisible> covisible;
  atlas_.FindCovisible(colon_.frames()[asked].keyframe, 1, &covisible);
  for (const Covisible& neighbour : covisible) EXPECT_GE(FrameOf(neighbour.keyframe), end);
  ASSERT_TRUE(Recognise(asked));
  EXPECT_EQ(task_.area.counts.map_b, task_.area.counts.map_a);
  EXPECT_LT(FrameOf(task_.area.keyframe_b), end);
}

// The same, when the keyframe that asks shares some points with the place itself.
TEST_F(PlaceRecogniserTest, APlaceThatSharesAFewOfItsPointsIsAsked) {
  const auto [first, end] = MapTwice();
  const int asked = end + 5;
  TakePointsOf(first + 4, 30, asked);
  const KeyframeHandle handle = colon_.frames()[asked].keyframe;
  std::vector<Covisible> covisible;
  atlas_.FindCovisible(handle, colon_.config().mapping.min_shared_points, &covisible);
  const auto is_old = [&](const Covisible& neighbour) { return FrameOf(neighbour.keyframe) < end; };
  ASSERT_TRUE(std::any_of(covisible.begin(), covisible.end(), is_old));
  EXPECT_TRUE(Recognise(asked));
  colon_.config().place.recognition.max_shared_share = 0.0;
  EXPECT_FALSE(Recognise(asked)) << "it was asked all the same";
}

TEST_F(PlaceRecogniserTest, PointsOfTheWiderGroupWithoutRoomAreLeftOutAndCounted) {
  colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const KeyframeHandle keyframe = colon_.frames()[6].keyframe;
  GroupExcerpt::Capacity capacity = GroupExcerpt::ForCandidate(colon_.config());
  GroupExcerpt whole(capacity, std::pmr::get_default_resource());
  ExcerptCopier copier(colon_.config());
  copier.CopyCandidate(atlas_, keyframe, keyframe, &whole);
  EXPECT_EQ(copier.num_points_left_out(), 0u);
  ASSERT_GT(whole.points.size(), whole.num_searched + 2);
  capacity.points = static_cast<int>(whole.num_searched) + 2;
  GroupExcerpt tight(capacity, std::pmr::get_default_resource());
  copier.CopyCandidate(atlas_, keyframe, keyframe, &tight);
  EXPECT_EQ(tight.num_searched, whole.num_searched);
  EXPECT_EQ(tight.points.size(), whole.num_searched + 2);
  EXPECT_GE(copier.num_points_left_out(), whole.points.size() - tight.points.size());
}

TEST_F(PlaceRecogniserTest, NewWallIsNotRecognised) {
  colon_.AddWall(0.0, 24.0, 8000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 12.0, 15.0, 14, map_from_world_).first;
  for (int i = 0; i < 14; ++i) EXPECT_FALSE(Recognise(first + i));
}

TEST_F(PlaceRecogniserTest, TwoPlacesOfOneMapThatAgreeAreAmbiguous) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddTwin(wall, 2500, 8.0, 0.0);
  colon_.AddMap(&atlas_, 0.0, 11.0, 48, Sim3{});
  const int first = colon_.AddMap(&atlas_, 8.0, 10.0, 10, map_from_world_).first;
  EXPECT_FALSE(Recognise(first + 4));
  EXPECT_EQ(ToString(task_.area.counts.verdict), "ambiguous");
  EXPECT_EQ(ToString(task_.report.tried.back().verdict), "ambiguous");
}

// The scope stands between the two places.
TEST_F(PlaceRecogniserTest, TwoPlacesSeenFromTheSamePositionAreAmbiguous) {
  RecordProperty("req", "MRG-001");
  const int wall = colon_.AddWall(3.0, 10.0, 25 * 97);
  const SE3 turned(ExpSO3({0.0, std::numbers::pi, 0.0}), {0.0, 0.0, 6.0});  // about (0, 0, 3)
  colon_.AddMovedTwin(wall, 25 * 97, turned);
  colon_.AddMapOfTwins(&atlas_, 2.9, 4.5, 16, turned, Sim3{});
  const int first = colon_.AddMap(&atlas_, 3.0, 3.1, 10, map_from_world_).first;
  EXPECT_FALSE(Recognise(first + 4));
  EXPECT_EQ(ToString(task_.area.counts.verdict), "ambiguous");
}

TEST_F(PlaceRecogniserTest, LostDeviceIsReported) {
  colon_.AddWall(0.0, 7.0, 2500);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, Sim3{});
  const int first = colon_.AddMap(&atlas_, 2.0, 4.0, 10, map_from_world_).first;
  colon_.device().SetLost(true);
  EXPECT_FALSE(Recognise(first + 2));
  ASSERT_EQ(task_.report.tried.size(), 1u);
  EXPECT_EQ(ToString(task_.report.tried[0].verdict), "device_failed");
}

}  // namespace
}  // namespace haustra::test
