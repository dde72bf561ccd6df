// Joins in slices of one piece of work each, while mapping goes on between them: keyframes come and go, and bundles
// move them until the first move. The truth is that of geometry.
#include <gtest/gtest.h>

#include "engine/atlas/invariants.h"
#include "engine/mapping/local_bundle.h"
#include "engine/merging/merger.h"
#include "tests/engine/merging/known_join.h"
#include "tests/hal/ticking_clock.h"

namespace haustra::test {
namespace {

const Sim3 kFirstFromWorld(1.7, ExpSO3({0.1, 0.4, -0.9}), {2.0, 0.5, -3.0});
const Sim3 kSecondFromWorld(0.6, ExpSO3({-0.2, 0.7, 1.1}), {1.0, 3.0, -2.0});

// A join worked slice by slice.
class SlicedJoin : public KnownJoin {
 public:
  SlicedJoin() : KnownJoin(5, 300) {}

  void Begin() {
    merger_.emplace(colon.config(), options, noise_, colon.camera(), colon.device(), adjuster_);
    ASSERT_TRUE(merger_->Begin(plan, atlas).ok());
  }
  Result<Merger::Progress> Slice() {
    ++num_slices;
    return merger_->Step({&clock_, slice_end, deadline}, plan.keyframe_a, &atlas);
  }
  // False: that was the last one.
  bool Step() {
    const Result<Merger::Progress> progress = Slice();
    EXPECT_TRUE(progress.ok());
    EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");
    return progress.ok() && *progress == Merger::Progress::kMore && !testing::Test::HasFailure();
  }
  const MergeOutcome& outcome() const { return merger_->outcome(); }
  // What was done so far that takes long.
  std::uint64_t num_searches() { return colon.device().num_calls(ScriptedVisionDevice::Operation::kGuidedMatch); }
  int num_iterations() const { return outcome().graph_iterations + outcome().weld_iterations; }
  // As the mapper does after a keyframe.
  void AdjustAround(int i) {
    LocalBundle bundle(colon.config(), noise_, colon.camera(), adjuster_);
    ASSERT_TRUE(bundle.Adjust(frame(i).keyframe, {6, true, 4}, {}, &atlas).ok());
  }
  void Cull(int i, int stand_in) {
    colon.device().ReleaseFeatureSet(atlas.RemoveKeyframe(frame(i).keyframe, frame(stand_in).keyframe));
  }

  // Of the keyframe's points: the median distance from where they are seen.
  double MedianReprojectionPx(int i) const {
    const Keyframe& keyframe = atlas.keyframe(frame(i).keyframe);
    std::vector<double> errors;
    for (int f = 0; f < keyframe.features.num; ++f) {
      if (!keyframe.points[f]) continue;
      Eigen::Vector2d pixel;
      const bool is_seen =
          colon.camera().Project(keyframe.cam_from_map * atlas.point(keyframe.points[f]).position, &pixel);
      errors.push_back(is_seen ? (pixel - keyframe.features.pixel(f)).norm() : 1000.0);
    }
    if (errors.size() < 20) return 1000.0;
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    return errors[errors.size() / 2];
  }

  MergingConfig options;
  TimePoint slice_end;  // unless it is set, every slice is over as soon as it looks at the clock
  TimePoint deadline = kNoDeadline;
  int num_slices = 0;

 private:
  NoiseModel noise_{colon.config().noise};
  SchurBundleAdjuster adjuster_;
  TickingClock clock_;
  std::optional<Merger> merger_;
};

struct Case {
  const char* name;
  int num_older;  // 0: a loop
  int max_nodes;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

class JoinSlices : public testing::TestWithParam<Case> {
 protected:
  void Make(SlicedJoin* join) {
    join->options.graph_max_nodes = GetParam().max_nodes;
    if (GetParam().num_older == 0) {
      MakeLoop(LoopShape{}, join);
    } else {
      MakeTwoMaps(GetParam().num_older, 24, 0.2, kFirstFromWorld, kSecondFromWorld, join);
    }
    // Off by so much that the weld and what follows it have something to move.
    join->plan.b_from_a.translation +=
        join->frame(join->frame_b).map_from_world.scale * Eigen::Vector3d(0.06, -0.04, 0.05);
    ASSERT_GE(join->plan.points.size(), 50u);
  }
  // Where a map of known frame stays; a loop has none.
  void ExpectTruth(const SlicedJoin& join) {
    const bool is_loop = GetParam().num_older == 0;
    const Sim3& map_from_world = GetParam().num_older >= 24 ? kFirstFromWorld : kSecondFromWorld;
    for (int i = 0; i < static_cast<int>(join.colon.frames().size()); ++i) {
      const Keyframe* keyframe = join.atlas.GetKeyframe(join.frame(i).keyframe);
      if (keyframe == nullptr) continue;
      EXPECT_LT(join.MedianReprojectionPx(i), is_loop ? 12.0 : 3.0) << "keyframe " << keyframe->id;
      if (is_loop) continue;
      const Eigen::Vector3d truth = map_from_world * join.frame(i).cam_from_world.InverseTranslation();
      EXPECT_LT((keyframe->cam_from_map.InverseTranslation() - truth).norm() / map_from_world.scale, 0.05)
          << "keyframe " << keyframe->id;
    }
    EXPECT_LT(join.RelativeError(join.frame_a, join.frame_b), 0.03);
  }
  int CountSlices() {
    SlicedJoin join;
    Make(&join);
    join.Begin();
    while (join.Step()) continue;
    ExpectTruth(join);
    return join.num_slices;
  }
};

TEST_P(JoinSlices, KeyframeThatComesBetweenAnyTwoIsCorrectedAsWell) {
  const int num_slices = CountSlices();
  ASSERT_GT(num_slices, 20);
  // Slices of the preparation are all alike.
  for (int gap = 1; gap < num_slices; gap += gap + 60 < num_slices ? 9 : 3) {
    SCOPED_TRACE("after slice " + std::to_string(gap));
    SlicedJoin join;
    Make(&join);
    join.Begin();
    // At the seam, where the tracker is, or at the other end of what moves.
    const int beside = gap % 2 == 0 ? join.frame_a : static_cast<int>(join.colon.frames().size()) - 1;
    int added = -1;
    while (join.Step()) {
      if (join.num_slices != gap) continue;
      added = join.InsertBeside(beside, 0.1);
      ASSERT_EQ(CheckInvariants(join.atlas).ToString(), "ok");
    }
    ASSERT_GE(added, 0);
    ExpectTruth(join);
    EXPECT_LT(join.RelativeError(added, beside), 0.03);
    if (HasFailure()) break;
  }
}

TEST_P(JoinSlices, MappingGoesOnBetweenAllOfThem) {
  SlicedJoin join;
  Make(&join);
  join.Begin();
  // Every few slices a keyframe comes, the bundle moves what is around it, and one far from it is culled.
  int newest = join.frame_a;
  int num_added = 0, num_culled = 0;
  const int num_frames = static_cast<int>(join.colon.frames().size());
  while (join.Step()) {
    if (join.num_slices % 7 == 0) {
      newest = join.InsertBeside(newest, num_added % 2 == 0 ? 0.06 : -0.05);
      if (!join.outcome().has_moved) join.AdjustAround(newest);
      ++num_added;
    }
    if (join.num_slices % 11 == 0 && num_culled < 5) {
      const int culled = num_frames - 6 - 3 * num_culled++;
      if (culled != join.frame_a && culled != join.frame_b) join.Cull(culled, culled + 1);
    }
    ASSERT_EQ(CheckInvariants(join.atlas).ToString(), "ok");
  }
  EXPECT_GE(num_added, 4);
  EXPECT_GE(num_culled, 2);
  ExpectTruth(join);
}

// The second shares most points with the first, which the weld does not know.
TEST(LoopSlices, TwoKeyframesThatComeWhileTheSeamIsWeldedGoAlongTogether) {
  SlicedJoin join;
  MakeLoop(LoopShape{}, &join);
  join.plan.b_from_a.translation += Eigen::Vector3d(0.06, -0.04, 0.05);
  join.Begin();
  int first = -1, second = -1;
  SE3 second_from_first, first_before;
  const auto pose = [&](int i) { return join.atlas.keyframe(join.frame(i).keyframe).cam_from_map; };
  while (join.Step()) {
    if (join.outcome().num_weld_keyframes == 0 || second >= 0) continue;
    if (first < 0) {
      first = join.InsertBeside(join.frame_a, 0.06);
      continue;
    }
    second = join.InsertBeside(first, 0.06);
    std::vector<Covisible> covisible;
    join.atlas.FindCovisible(join.frame(second).keyframe, 1, &covisible);
    ASSERT_FALSE(covisible.empty());
    ASSERT_EQ(covisible.front().keyframe, join.frame(first).keyframe);
    first_before = pose(first);
    second_from_first = pose(second) * pose(first).Inverse();
  }
  ASSERT_GE(second, 0);
  EXPECT_GT((pose(first).InverseTranslation() - first_before.InverseTranslation()).norm(), 1e-3) << "the weld moved it";
  const SE3 after = pose(second) * pose(first).Inverse();
  EXPECT_LT((after.translation - second_from_first.translation).norm(), 1e-9);
  EXPECT_LT(after.rotation.angularDistance(second_from_first.rotation), 1e-9);
}

// A keyframe waits for one piece of work at most: a node of the graph or its edges, a search, a step of a solver.
TEST_P(JoinSlices, NoSliceDoesMoreThanOnePiece) {
  SlicedJoin join;
  Make(&join);
  join.Begin();
  int num_preparing = 0;
  bool goes_on = true;
  while (goes_on) {
    SCOPED_TRACE("slice " + std::to_string(join.num_slices));
    const std::uint64_t num_searches = join.num_searches();
    const int num_iterations = join.num_iterations();
    goes_on = join.Step();
    EXPECT_LE(join.num_searches() - num_searches + static_cast<unsigned>(join.num_iterations() - num_iterations), 1u);
    if (!join.outcome().has_moved && join.num_iterations() == 0) ++num_preparing;
  }
  EXPECT_GT(join.outcome().num_graph_nodes, 2);
  EXPECT_GE(num_preparing, 2 * join.outcome().num_graph_nodes);
  EXPECT_GE(join.num_searches(), 4u);
  EXPECT_GE(join.outcome().weld_iterations, 2);
}

// The moves are linear in the atlas. However much time there is, nothing else is done in their slices.
TEST_P(JoinSlices, MovesHaveSlicesOfTheirOwn) {
  SlicedJoin join;
  Make(&join);
  join.slice_end = TimePoint(std::chrono::hours(1));
  join.Begin();
  std::vector<bool> is_move;
  bool goes_on = true;
  while (goes_on) {
    const std::uint64_t num_searches = join.num_searches();
    const int num_iterations = join.num_iterations();
    goes_on = join.Step();
    is_move.push_back(join.outcome().is_reframed);
    if (!is_move.back()) continue;
    EXPECT_EQ(join.num_searches(), num_searches);
    EXPECT_EQ(join.num_iterations(), num_iterations);
  }
  EXPECT_EQ(is_move, std::vector<bool>({false, true, false, true}));
}

TEST_P(JoinSlices, PreparationEndsWithItsTime) {
  SlicedJoin join;
  Make(&join);
  constexpr int kLooks = 9;
  join.deadline = TickingClock::DeadlineAtLook(kLooks);
  join.Begin();
  Result<Merger::Progress> progress = join.Slice();
  while (progress.ok() && *progress == Merger::Progress::kMore) progress = join.Slice();
  EXPECT_EQ(progress.code(), StatusCode::kDeadlineExceeded);
  EXPECT_LE(join.num_slices, kLooks);
  EXPECT_FALSE(join.outcome().has_moved);
}

INSTANTIATE_TEST_SUITE_P(Of, JoinSlices,
                         testing::Values(Case{"Loop", 0, 256}, Case{"LoopInGroups", 0, 12},
                                         Case{"YoungerMapMoves", 26, 256}, Case{"OlderMapMoves", 14, 256},
                                         Case{"MapMovesInGroups", 26, 10}),
                         [](const auto& tested) { return tested.param.name; });

// Two maps whose younger one moves and is welded; the older one's frame is the truth for both. What its keyframes
// beyond the seam see follows the weld.
class PointsBesideTheSeam : public testing::Test {
 protected:
  PointsBesideTheSeam() {
    MakeTwoMaps(26, 24, 0.2, kFirstFromWorld, kSecondFromWorld, &join_);
    // Off by so much that whoever is left behind, or moved twice, shows it.
    join_.plan.b_from_a.translation += kFirstFromWorld.scale * Eigen::Vector3d(0.06, -0.04, 0.05);
  }
  // Keyframe of the map that moves, counted from the one of the plan.
  const SyntheticColon::Frame& FrameOf(int i) const { return join_.frame(join_.frame_a + i); }
  bool IsWelding() const { return join_.outcome().num_weld_keyframes > 0; }
  // Points of a keyframe that so many of those at the seam see.
  std::vector<MapPointHandle> PointsOfFollower(int i, int num_at_seam) const {
    std::vector<MapPointHandle> points;
    const Keyframe& keyframe = join_.atlas.keyframe(FrameOf(i).keyframe);
    for (int f = 0; f < keyframe.features.num; ++f) {
      if (keyframe.points[f] && NumAtSeam(keyframe.points[f]) == num_at_seam) points.push_back(keyframe.points[f]);
    }
    return points;
  }
  int NumAtSeam(MapPointHandle point) const {
    int num = 0;
    for (int i = -2; i < kNumAtSeam; ++i) {
      num += join_.atlas.FeatureOf(join_.atlas.point(point), FrameOf(i).keyframe) >= 0;
    }
    return num;
  }
  // The largest distance of a point from its truth, in units of the tube.
  double WorstError(std::span<const MapPointHandle> points) const {
    double worst = 0.0;
    for (const MapPointHandle handle : points) {
      const MapPoint* point = join_.atlas.GetPoint(handle);
      if (point == nullptr) continue;
      const Eigen::Vector3d truth = kFirstFromWorld * join_.colon.LandmarkOf(*point).position;
      worst = std::max(worst, (point->position - truth).norm() / kFirstFromWorld.scale);
    }
    return worst;
  }

  // Of the map that moves: the plan's keyframe has its window around it, two before and the others after it.
  static constexpr int kNumAtSeam = 6;
  static constexpr double kMaxError = 0.04;
  SlicedJoin join_;
};

// Between two slices mapping finds a point of what follows at the seam: the weld, which works on a copy, knows nothing
// of it.
TEST_F(PointsBesideTheSeam, OneThatIsSeenFromTheSeamLaterFollows) {
  struct Sight {
    MapPointHandle point;
    KeyframeHandle keyframe;
    std::int32_t feature = -1;
  };
  std::vector<Sight> sights;
  std::vector<MapPointHandle> points;
  // Taken out of all keyframes at the seam, to be found in one of them later.
  const Keyframe& follower = join_.atlas.keyframe(FrameOf(kNumAtSeam + 2).keyframe);
  for (int f = 0; f < follower.features.num && points.size() < 20; ++f) {
    const MapPointHandle point = follower.points[f];
    if (!point || NumAtSeam(point) == 0) continue;
    if (static_cast<int>(join_.atlas.point(point).observations.size()) < NumAtSeam(point) + 3) continue;
    Sight sight;
    for (int i = -2; i < kNumAtSeam; ++i) {
      const std::int32_t feature = join_.atlas.FeatureOf(join_.atlas.point(point), FrameOf(i).keyframe);
      if (feature < 0) continue;
      sight = {point, FrameOf(i).keyframe, feature};
      ASSERT_TRUE(join_.atlas.RemoveObservation(point, sight.keyframe));
    }
    join_.atlas.UpdatePoint(point);
    sights.push_back(sight);
    points.push_back(point);
  }
  ASSERT_GE(points.size(), 10u);
  join_.Begin();
  bool is_found = false;
  while (join_.Step()) {
    if (is_found || !IsWelding()) continue;
    is_found = true;
    for (const Sight& sight : sights) join_.atlas.AddObservation(sight.point, sight.keyframe, sight.feature);
  }
  ASSERT_TRUE(is_found);
  EXPECT_LT(WorstError(points), kMaxError);
}

// In the weld one view says nothing of how far away a point is; the keyframe that has it does.
TEST_F(PointsBesideTheSeam, OneThatASingleKeyframeOfTheWeldSeesGoesWithIt) {
  std::vector<MapPointHandle> points;
  for (int i = 1; i < 6; ++i) {
    for (const MapPointHandle point : PointsOfFollower(kNumAtSeam + i, 1)) points.push_back(point);
  }
  ASSERT_GE(points.size(), 20u);
  join_.Begin();
  while (join_.Step()) continue;
  EXPECT_LT(WorstError(points), kMaxError);
}

// A keyframe that comes before the seam is copied is welded, and with it what else only keyframes see that follow.
TEST_F(PointsBesideTheSeam, OneThatANewKeyframeBringsIntoTheWeldIsMovedOnce) {
  join_.Begin();
  int added = -1;
  std::vector<MapPointHandle> points;
  while (join_.Step()) {
    if (added >= 0 || !join_.outcome().has_moved) continue;
    const int edge = join_.frame_a + kNumAtSeam - 1;
    added = join_.InsertBeside(edge, 0.7);
    for (int i = kNumAtSeam; i < kNumAtSeam + 8; ++i) {
      join_.colon.Link(&join_.atlas, added, join_.frame_a + i, join_.MapFromWorldAt(edge));
    }
    const KeyframeHandle keyframe = join_.frame(added).keyframe;
    for (const MapPointHandle point : PointsOfFollower(kNumAtSeam + 4, 0)) {
      if (join_.atlas.FeatureOf(join_.atlas.point(point), keyframe) >= 0) points.push_back(point);
    }
  }
  ASSERT_GE(points.size(), 5u);
  EXPECT_LT(WorstError(points), kMaxError);
}

}  // namespace
}  // namespace haustra::test
