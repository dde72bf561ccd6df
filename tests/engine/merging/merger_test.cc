// Merges and loops on synthetic maps: what the merged atlas says about every keyframe, point and tracked frame is held
// against the known world.
#include "engine/merging/merger.h"

#include <gtest/gtest.h>

#include <span>

#include "engine/atlas/invariants.h"
#include "tests/engine/place/synthetic_colon.h"
#include "tests/hal/ticking_clock.h"

namespace haustra::test {
namespace {

const Sim3 kOlderFromWorld(1.7, ExpSO3({0.1, 0.4, -0.9}), {2.0, 0.5, -3.0});
const Sim3 kYoungerFromWorld(0.6, ExpSO3({-0.2, 0.7, 1.1}), {1.0, 3.0, -2.0});

class MergerTest : public testing::Test {
 protected:
  MergerTest() : colon_(5), atlas_(colon_.MakeAtlas()), rng_(17) {}

  KeyframeHandle keyframe(int frame) const { return colon_.frames()[frame].keyframe; }

  // Proves the common area of two keyframes, as the mapper would.
  MergePlan Plan(int frame_a, int frame_b) {
    CommonAreaVerifier verifier(colon_.config(), common_area_, noise_, colon_.camera(), colon_.scene(),
                                colon_.device());
    CommonArea area;
    EXPECT_TRUE(colon_.Verify(verifier, atlas_, keyframe(frame_a), keyframe(frame_b), rng_, &area))
        << ToString(area.counts.verdict);
    return MakeMergePlan(area);
  }

  Status Apply(const MergePlan& plan) { return ApplySeenFrom(plan, plan.keyframe_a); }

  // Tracking is at the keyframe.
  Status ApplySeenFrom(const MergePlan& plan, KeyframeHandle tracked) { return Join(plan, tracked, {}, &atlas_); }

  // The join's time is over when it looks at the clock for the `num_looks`-th time, counted from 0.
  Status ApplyStopped(const MergePlan& plan, int num_looks, Atlas* atlas) {
    const TickingClock clock;
    return Join(plan, plan.keyframe_a, {&clock, kNoDeadline, TickingClock::DeadlineAtLook(num_looks)}, atlas);
  }

  // In one slice.
  Status Join(const MergePlan& plan, KeyframeHandle tracked, const JoinLimits& limits, Atlas* atlas) {
    SchurBundleAdjuster adjuster;
    Merger merger(colon_.config(), options_, noise_, colon_.camera(), colon_.device(), adjuster);
    HAUSTRA_TRY(merger.Begin(plan, *atlas));
    const Result<Merger::Progress> progress = merger.Step(limits, tracked, atlas);
    outcome_ = merger.outcome();
    if (!progress.ok()) return progress.status();
    EXPECT_EQ(*progress, Merger::Progress::kDone);
    return Status::Ok();
  }

  // Features that show a point, over all keyframes.
  static int NumObservations(const Atlas& atlas) {
    int num = 0;
    atlas.keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) { num += keyframe.num_points; });
    return num;
  }

  void ExpectUntouched(const Atlas& before) {
    EXPECT_EQ(NumObservations(atlas_), NumObservations(before));
    EXPECT_EQ(atlas_.points().size(), before.points().size());
    before.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& keyframe) {
      ASSERT_EQ(atlas_.keyframe(handle).cam_from_map.translation, keyframe.cam_from_map.translation);
      ASSERT_EQ(atlas_.keyframe(handle).map, keyframe.map);
      ASSERT_EQ(atlas_.KeyframeScale(handle), before.KeyframeScale(handle));
    });
    before.points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
      ASSERT_EQ(atlas_.point(handle).position, point.position);
    });
  }

  // Largest distance of a camera or point from where map_from_world puts it, over the map's unit.
  void ExpectInFrame(const Sim3& map_from_world, double max_camera, double max_median_point) {
    for (const SyntheticColon::Frame& frame : colon_.frames()) {
      const Keyframe* keyframe = atlas_.GetKeyframe(frame.keyframe);
      if (keyframe == nullptr) continue;
      const Eigen::Vector3d truth = map_from_world * frame.cam_from_world.InverseTranslation();
      EXPECT_LT((keyframe->cam_from_map.InverseTranslation() - truth).norm() / map_from_world.scale, max_camera)
          << "keyframe " << keyframe->id;
      const SE3 pose = TransformPose(frame.cam_from_world, map_from_world);
      EXPECT_LT(RotationAngle(keyframe->cam_from_map.rotation, pose.rotation), 0.01) << "keyframe " << keyframe->id;
    }
    std::vector<double> errors;
    atlas_.points().ForEach([&](MapPointHandle, const MapPoint& point) {
      const Eigen::Vector3d truth = map_from_world * colon_.LandmarkOf(point).position;
      errors.push_back((point.position - truth).norm() / map_from_world.scale);
    });
    ASSERT_FALSE(errors.empty());
    std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2), errors.end());
    EXPECT_LT(errors[errors.size() / 2], max_median_point);
  }

  // A frame that was tracked before the merge relative to a keyframe, somewhere off it.
  struct Tracked {
    KeyframeId reference;
    SE3 cam_from_reference;
    double scale;
    SE3 cam_from_world;
  };
  Tracked Track(int frame) {
    const SyntheticColon::Frame& f = colon_.frames()[frame];
    const SE3 offset(ExpSO3({0.05, -0.1, 0.02}), {0.1, 0.05, -0.2});  // world units
    SE3 in_map = offset;
    in_map.translation *= f.map_from_world.scale;
    return {atlas_.keyframe(f.keyframe).id, in_map, atlas_.KeyframeScale(f.keyframe), offset * f.cam_from_world};
  }
  void ExpectResolves(const Tracked& tracked, MapId map_id, const Sim3& map_from_world, double tolerance) {
    ResolvedPose resolved;
    ASSERT_TRUE(atlas_.Resolve(tracked.reference, tracked.cam_from_reference, tracked.scale, &resolved));
    EXPECT_EQ(resolved.map_id, map_id);
    const Eigen::Vector3d truth = map_from_world * tracked.cam_from_world.InverseTranslation();
    EXPECT_LT((resolved.cam_from_map.InverseTranslation() - truth).norm() / map_from_world.scale, tolerance);
  }

  SyntheticColon colon_;
  NoiseModel noise_{colon_.config().noise};
  Atlas atlas_;
  Rng rng_;
  CommonAreaConfig common_area_;
  MergingConfig options_;
  MergeOutcome outcome_;
};

TEST_F(MergerTest, YoungerActiveMapMovesIntoTheOlderOne) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MapHandle older = atlas_.keyframe(keyframe(0)).map, younger = atlas_.keyframe(keyframe(first)).map;
  atlas_.map(older).status = MapStatus::kStored;
  const int points_before = atlas_.map(older).num_points + atlas_.map(younger).num_points;
  const Tracked in_older = Track(4), in_younger = Track(first + 7), near_seam = Track(first + 2);

  ASSERT_TRUE(Apply(Plan(first + 2, 11)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_FALSE(outcome_.is_loop);
  EXPECT_EQ(outcome_.map, older);
  EXPECT_EQ(outcome_.map_id, 0u);
  EXPECT_EQ(outcome_.absorbed_map_id, 1u);
  EXPECT_EQ(atlas_.map(older).status, MapStatus::kActive);
  EXPECT_EQ(atlas_.map(younger).status, MapStatus::kMerged);
  EXPECT_EQ(atlas_.map(younger).merged_into, 0u);
  EXPECT_EQ(atlas_.map(older).keyframes.size(), 28u);
  EXPECT_TRUE(atlas_.map(younger).keyframes.empty());
  EXPECT_GE(outcome_.num_fused, 150);
  EXPECT_LE(static_cast<int>(atlas_.points().size()), points_before - 150);

  ExpectInFrame(kOlderFromWorld, 0.03, 0.02);
  ExpectResolves(in_older, 0, kOlderFromWorld, 0.03);
  ExpectResolves(in_younger, 0, kOlderFromWorld, 0.03);
  ExpectResolves(near_seam, 0, kOlderFromWorld, 0.03);
}

TEST_F(MergerTest, WeldCorrectsThePlansSimilarity) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  MergePlan plan = Plan(first + 2, 11);
  const Eigen::Vector3d error_in_world(0.06, -0.04, 0.05);
  plan.b_from_a.translation += kOlderFromWorld.scale * error_in_world;
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_LT(outcome_.weld_final_cost, 0.5 * outcome_.weld_initial_cost);
  ExpectInFrame(kOlderFromWorld, 0.5 * error_in_world.norm(), 0.03);
}

TEST_F(MergerTest, TrackerIsToldWhereItsFrameWent) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const SE3 before = atlas_.keyframe(keyframe(first + 2)).cam_from_map;
  ASSERT_TRUE(Apply(Plan(first + 2, 11)).ok());
  EXPECT_EQ(outcome_.reframing.old_map_id, 1u);
  EXPECT_EQ(outcome_.reframing.new_map_id, 0u);
  // Exactly the keyframe's own way, and the truth to within noise.
  const SE3 after = atlas_.keyframe(keyframe(first + 2)).cam_from_map;
  const SE3 moved = TransformPose(before, outcome_.reframing.new_from_old);
  EXPECT_LT((moved.translation - after.translation).norm(), 1e-9);
  EXPECT_LT(RotationAngle(moved.rotation, after.rotation), 1e-7);
  const Sim3 truth = kOlderFromWorld * kYoungerFromWorld.Inverse();
  EXPECT_NEAR(outcome_.reframing.new_from_old.scale / truth.scale, 1.0, 0.02);
}

TEST_F(MergerTest, StoredYoungerMapComesIntoTheActiveOlderOne) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MapHandle older = atlas_.keyframe(keyframe(0)).map, younger = atlas_.keyframe(keyframe(first)).map;
  atlas_.map(younger).status = MapStatus::kStored;
  const Tracked in_younger = Track(first + 9);
  ASSERT_TRUE(Apply(Plan(11, first + 2)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_EQ(outcome_.map, older);
  EXPECT_EQ(outcome_.absorbed_map_id, 1u);
  EXPECT_EQ(outcome_.reframing.old_map_id, 0u);
  EXPECT_EQ(outcome_.reframing.new_map_id, 0u);
  EXPECT_NEAR(outcome_.reframing.new_from_old.scale, 1.0, 1e-9);
  ExpectInFrame(kOlderFromWorld, 0.03, 0.02);
  ExpectResolves(in_younger, 0, kOlderFromWorld, 0.03);
}

TEST_F(MergerTest, FramesOfCulledKeyframesResolveAcrossTheMerge) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const Tracked culled_before = Track(first + 6), culled_after = Track(first + 9);
  colon_.device().ReleaseFeatureSet(atlas_.RemoveKeyframe(keyframe(first + 6), keyframe(first + 7)));
  ASSERT_TRUE(Apply(Plan(first + 2, 11)).ok());
  colon_.device().ReleaseFeatureSet(atlas_.RemoveKeyframe(keyframe(first + 9), keyframe(first + 10)));
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  ExpectResolves(culled_before, 0, kOlderFromWorld, 0.03);
  ExpectResolves(culled_after, 0, kOlderFromWorld, 0.03);
}

TEST_F(MergerTest, LongYoungerMapFollowsTheWeld) {
  colon_.AddWall(0.0, 14.0, 5000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 41, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 10.0, 40, kYoungerFromWorld).first;
  const Tracked far_off = Track(first + 39);
  ASSERT_TRUE(Apply(Plan(first + 2, 34)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_EQ(outcome_.num_graph_nodes, 40);
  EXPECT_GE(outcome_.num_graph_edges, 39);
  EXPECT_LE(outcome_.num_weld_keyframes, 16);
  ExpectInFrame(kOlderFromWorld, 0.05, 0.03);
  ExpectResolves(far_off, 0, kOlderFromWorld, 0.05);
}

// Marks of the map that moves, at its seam and far from it, and of the one that stays.
TEST_F(MergerTest, MarksFollowTheJoin) {
  colon_.AddWall(0.0, 14.0, 5000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 41, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 10.0, 40, kYoungerFromWorld).first;
  struct Marked {
    MarkHandle mark;
    Eigen::Vector3d in_world;
  };
  std::vector<Marked> marks;
  for (const auto& [label, frame] :
       {std::pair("stays", 20), std::pair("seam", first + 2), std::pair("far", first + 35)}) {
    const SyntheticColon::Frame& seen_from = colon_.frames()[static_cast<std::size_t>(frame)];
    const Eigen::Vector3d in_world = seen_from.cam_from_world.Inverse() * Eigen::Vector3d(0.4, 0.5, 1.2);
    Mark mark;
    mark.label = MarkLabel::From(label).value();
    PlacedMark place;
    place.map = atlas_.keyframe(seen_from.keyframe).map;
    place.position = seen_from.map_from_world * in_world;
    place.normal = Eigen::Vector3d::UnitX();
    place.radius = 0.1;
    marks.push_back({atlas_.AddMark(mark, seen_from.keyframe, place), in_world});
  }
  ASSERT_TRUE(Apply(Plan(first + 2, 34)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  for (const Marked& marked : marks) {
    const PlacedMark place = atlas_.PlaceOf(atlas_.marks().At(marked.mark));
    EXPECT_EQ(atlas_.map(place.map).id, 0u);
    EXPECT_LT((place.position - kOlderFromWorld * marked.in_world).norm() / kOlderFromWorld.scale, 0.05);
  }
}

// A long procedure is being tracked when it meets what a short one has left: the long one stays where it is, and with
// it the tracker.
TEST_F(MergerTest, LargerMapStaysThoughItIsTheYoungerOne) {
  colon_.AddWall(0.0, 14.0, 5000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 10.0, 40, kYoungerFromWorld).first;
  const MapHandle older = atlas_.keyframe(keyframe(0)).map, younger = atlas_.keyframe(keyframe(first)).map;
  atlas_.map(older).status = MapStatus::kStored;
  const Tracked in_older = Track(3), in_younger = Track(first + 30);
  const SE3 far_off = atlas_.keyframe(keyframe(first + 39)).cam_from_map;
  ASSERT_TRUE(Apply(Plan(first + 2, 11)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_EQ(outcome_.map, younger);
  EXPECT_EQ(outcome_.absorbed, older);
  EXPECT_EQ(outcome_.absorbed_map_id, 0u);
  EXPECT_EQ(atlas_.map(younger).status, MapStatus::kActive);
  EXPECT_EQ(atlas_.map(older).merged_into, 1u);
  EXPECT_EQ(outcome_.reframing.old_map_id, 1u);
  EXPECT_EQ(outcome_.reframing.new_map_id, 1u);
  EXPECT_EQ(atlas_.keyframe(keyframe(first + 39)).cam_from_map.translation, far_off.translation);
  ExpectInFrame(kYoungerFromWorld, 0.05, 0.03);
  ExpectResolves(in_older, 1, kYoungerFromWorld, 0.05);
  ExpectResolves(in_younger, 1, kYoungerFromWorld, 0.05);
}

// With fewer nodes than keyframes the map follows nearly as well.
TEST_F(MergerTest, LongMapFollowsTheWeldInGroups) {
  options_.graph_max_nodes = 10;
  colon_.AddWall(0.0, 14.0, 5000);
  const int first = colon_.AddMap(&atlas_, 2.0, 10.0, 40, kOlderFromWorld).first;
  colon_.AddMap(&atlas_, 0.0, 3.0, 41, kYoungerFromWorld);
  const Tracked far_off = Track(first + 39);
  ASSERT_TRUE(Apply(Plan(first + 2, 40 + 33)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_GE(outcome_.num_graph_nodes, 10);
  EXPECT_LE(outcome_.num_graph_nodes, 22);
  ExpectInFrame(kYoungerFromWorld, 0.05, 0.03);
  ExpectResolves(far_off, 1, kYoungerFromWorld, 0.05);
}

TEST_F(MergerTest, SameMergeGivesTheSameBits) {
  double sums[2] = {0.0, 0.0};
  for (double& sum : sums) {
    SyntheticColon colon(9);
    Atlas atlas = colon.MakeAtlas();
    colon.AddWall(0.0, 9.0, 3000);
    colon.AddMap(&atlas, 0.0, 3.0, 14, kOlderFromWorld);
    const int first = colon.AddMap(&atlas, 2.0, 5.0, 14, kYoungerFromWorld).first;
    CommonAreaVerifier verifier(colon.config(), common_area_, noise_, colon.camera(), colon.scene(), colon.device());
    CommonArea area;
    Rng rng(4);
    ASSERT_TRUE(
        colon.Verify(verifier, atlas, colon.frames()[first + 2].keyframe, colon.frames()[11].keyframe, rng, &area));
    SchurBundleAdjuster adjuster;
    Merger merger(colon.config(), options_, noise_, colon.camera(), colon.device(), adjuster);
    const MergePlan plan = MakeMergePlan(area);
    ASSERT_TRUE(merger.Begin(plan, atlas).ok());
    ASSERT_TRUE(merger.Step({}, plan.keyframe_a, &atlas).ok());
    atlas.points().ForEach([&](MapPointHandle, const MapPoint& point) { sum += point.position.sum(); });
    atlas.keyframes().ForEach([&](KeyframeHandle, const Keyframe& k) { sum += k.cam_from_map.translation.sum(); });
  }
  EXPECT_EQ(sums[0], sums[1]);
}

TEST_F(MergerTest, StalePlanIsRefusedAndNothingTouched) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MergePlan plan = Plan(first + 2, 11);
  colon_.device().ReleaseFeatureSet(atlas_.RemoveKeyframe(keyframe(11), keyframe(10)));
  const SE3 before = atlas_.keyframe(keyframe(first)).cam_from_map;
  EXPECT_EQ(Apply(plan).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(atlas_.keyframe(keyframe(first)).cam_from_map.translation, before.translation);
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

// Between proof and application both maps may be moved, and so may single keyframes: the plan goes along.
TEST_F(MergerTest, PlanGoesAlongWithMapsThatMoved) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MergePlan plan = Plan(first + 2, 11);
  const Sim3 older_moved(1.4, ExpSO3({0.5, -0.3, 0.2}), {-1.0, 2.0, 0.5});
  const Sim3 younger_moved(0.7, ExpSO3({-0.4, 0.1, 0.9}), {0.3, -4.0, 1.0});
  atlas_.TransformMap(atlas_.keyframe(keyframe(0)).map, older_moved);
  atlas_.TransformMap(atlas_.keyframe(keyframe(first)).map, younger_moved);
  const Tracked in_younger{atlas_.keyframe(keyframe(first + 7)).id, SE3{}, atlas_.KeyframeScale(keyframe(first + 7)),
                           colon_.frames()[first + 7].cam_from_world};
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_GE(outcome_.num_fused, 150);
  ExpectInFrame(older_moved * kOlderFromWorld, 0.03, 0.02);
  ExpectResolves(in_younger, 0, older_moved * kOlderFromWorld, 0.03);
}

TEST_F(MergerTest, TrackerElsewhereInTheMapIsToldWhereThatPlaceWent) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const KeyframeHandle tracked = keyframe(first + 9);
  const SE3 before = atlas_.keyframe(tracked).cam_from_map;
  ASSERT_TRUE(ApplySeenFrom(Plan(first + 2, 11), tracked).ok());
  const SE3 told = TransformPose(before, outcome_.reframing.new_from_old);
  const SE3 after = atlas_.keyframe(tracked).cam_from_map;
  EXPECT_LT((told.translation - after.translation).norm(), 1e-9);
  EXPECT_LT(RotationAngle(told.rotation, after.rotation), 1e-9);
}

TEST_F(MergerTest, TrackerInAnotherMapMakesThePlanStale) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MergePlan plan = Plan(first + 2, 11);
  EXPECT_EQ(ApplySeenFrom(plan, keyframe(0)).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(atlas_.maps().size(), 2u);
}

TEST_F(MergerTest, ImpossibleScaleIsRefused) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  MergePlan plan = Plan(first + 2, 11);
  plan.b_from_a.scale = 0.0;
  EXPECT_EQ(Apply(plan).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
}

TEST_F(MergerTest, DeviceLostDuringTheMergeLeavesAConsistentAtlas) {
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  const MergePlan plan = Plan(first + 2, 11);
  colon_.device().SetLost(true);
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  // The proven pairs alone hold it together.
  EXPECT_EQ(outcome_.num_fused, static_cast<int>(plan.points.size()));
  ExpectInFrame(kOlderFromWorld, 0.05, 0.03);
}

// A weld that was stopped says nothing about which observations are wrong: the joined maps keep all they had.
TEST_F(MergerTest, StoppedWeldDeletesNoObservation) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 9.0, 3000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 14, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 5.0, 14, kYoungerFromWorld).first;
  MergePlan plan = Plan(first + 2, 11);
  // Far enough off that much of what is right does not fit before it is welded.
  plan.b_from_a.translation += kOlderFromWorld.scale * Eigen::Vector3d(0.06, -0.04, 0.05);
  const int num_before = NumObservations(atlas_);
  const Atlas before = atlas_;
  int num_stopped = 0;
  for (int num_looks = 0; num_looks < 200 && outcome_.weld_state != SolveState::kConverged; ++num_looks) {
    SCOPED_TRACE(num_looks);
    atlas_ = before;
    if (!ApplyStopped(plan, num_looks, &atlas_).ok()) continue;  // before the maps were one
    if (outcome_.weld_state == SolveState::kConverged) continue;
    ++num_stopped;
    EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
    EXPECT_GE(NumObservations(atlas_), num_before);
    ExpectInFrame(kOlderFromWorld, 0.15, 0.15);
  }
  EXPECT_GE(num_stopped, 3);
  EXPECT_EQ(outcome_.weld_state, SolveState::kConverged);
}

// Wherever the time runs out, nothing was touched, or the younger map is in one piece and where the plan or the weld
// puts it.
TEST_F(MergerTest, TimeMayRunOutAnywhere) {
  RecordProperty("req", "MRG-001");
  colon_.AddWall(0.0, 14.0, 5000);
  colon_.AddMap(&atlas_, 0.0, 3.0, 41, kOlderFromWorld);
  const int first = colon_.AddMap(&atlas_, 2.0, 10.0, 40, kYoungerFromWorld).first;
  const MergePlan plan = Plan(first + 2, 34);
  const Atlas before = atlas_;
  int num_refused = 0;
  bool is_finished = false;
  // Most looks are those of the preparation, which are all alike.
  for (int num_looks = 0; num_looks < 200 && !is_finished; num_looks += num_looks < 70 ? 10 : 1) {
    SCOPED_TRACE(num_looks);
    atlas_ = before;
    const Status status = ApplyStopped(plan, num_looks, &atlas_);
    ASSERT_EQ(CheckInvariants(atlas_).ToString(), "ok");
    if (!status.ok()) {
      ++num_refused;
      EXPECT_EQ(status.code(), StatusCode::kDeadlineExceeded);
      ExpectUntouched(before);
      continue;
    }
    ExpectInFrame(kOlderFromWorld, 0.08, 0.04);
    ASSERT_FALSE(HasNonfatalFailure());
    is_finished = outcome_.weld_state == SolveState::kConverged && outcome_.graph_state == SolveState::kConverged;
  }
  EXPECT_GT(num_refused, 0);
  EXPECT_TRUE(is_finished);
}

// Out and back in one map whose frame drifts a little at every keyframe; the way back makes points of its own.
class LoopTest : public MergerTest {
 protected:
  void BuildDriftingMap() {
    colon_.AddWall(0.0, 10.0, 4000);
    const MapHandle map = atlas_.CreateMap();
    Sim3 drifted_from_world;
    const SE3 still;
    for (int i = 0; i < 2 * kTurn; ++i) {
      const double z = i < kTurn ? 0.18 * i : 0.18 * (2 * kTurn - 1 - i) + 0.05;
      const SE3 view = colon_.ViewFrom(z);
      colon_.AddKeyframe(&atlas_, map, view, drifted_from_world);
      // Grows, turns and slips about the camera, as drift does.
      const Eigen::Vector3d centre = drifted_from_world * view.InverseTranslation();
      const Sim3 to_camera(1.0, Eigen::Quaterniond::Identity(), -centre);
      const Sim3 slip(1.004, ExpSO3({0.002, -0.001, 0.001}), {0.002, 0.001, -0.002});
      drifted_from_world = to_camera.Inverse() * slip * to_camera * drifted_from_world;
    }
    colon_.AddPoints(&atlas_, 0, 2 * kTurn, 0.003, [](int frame, int landmark) {
      const bool still_outbound = frame < kTurn || (frame < kTurn + 6 && landmark % 2 == 0);
      return still_outbound ? 0 : 1;
    });
  }

  // Root mean square distance of the cameras from the truth after the best alignment.
  double TrajectoryError() {
    std::vector<Eigen::Vector3d> estimate, truth;
    for (const SyntheticColon::Frame& frame : colon_.frames()) {
      estimate.push_back(atlas_.keyframe(frame.keyframe).cam_from_map.InverseTranslation());
      truth.push_back(frame.cam_from_world.InverseTranslation());
    }
    Sim3 world_from_map;
    EXPECT_TRUE(AlignSim3(estimate, truth, &world_from_map));
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += (world_from_map * estimate[i] - truth[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }

  static constexpr int kTurn = 30;
};

TEST_F(LoopTest, DriftIsTakenOut) {
  BuildDriftingMap();
  const double before = TrajectoryError();
  // The last keyframe is back where the second was.
  const MergePlan plan = Plan(2 * kTurn - 2, 1);
  const KeyframeHandle newest = keyframe(2 * kTurn - 2);
  const SE3 pose_before = atlas_.keyframe(newest).cam_from_map;
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_TRUE(outcome_.is_loop);
  EXPECT_EQ(outcome_.absorbed_map_id, kNoId);
  EXPECT_EQ(outcome_.num_graph_nodes, 2 * kTurn);
  EXPECT_GE(outcome_.num_fused, 100);
  EXPECT_LT(TrajectoryError(), 0.4 * before);
  EXPECT_LT((TransformPose(pose_before, outcome_.reframing.new_from_old).translation -
             atlas_.keyframe(newest).cam_from_map.translation)
                .norm(),
            1e-9);
  // Both ends are connected now.
  std::vector<Covisible> covisible;
  atlas_.FindCovisible(newest, 30, &covisible);
  const bool is_joined = std::any_of(covisible.begin(), covisible.end(),
                                     [&](const Covisible& c) { return atlas_.keyframe(c.keyframe).id < 6; });
  EXPECT_TRUE(is_joined);
}

// Ends that share a few points already are still two ends: neither may pin the other where it stands.
TEST_F(LoopTest, DriftIsTakenOutWhereTheEndsShareAFewPoints) {
  BuildDriftingMap();
  const double before = TrajectoryError();
  const MergePlan plan = Plan(2 * kTurn - 2, 1);
  constexpr std::size_t kNumShared = 20;
  ASSERT_GE(plan.points.size(), 2 * kNumShared);
  for (const CommonPoint& common : std::span(plan.points).first(kNumShared)) {
    atlas_.FusePoints(common.point_a, common.point_b);
  }
  std::vector<Covisible> covisible;
  atlas_.FindCovisible(plan.keyframe_b, colon_.config().mapping.min_shared_points, &covisible);
  ASSERT_TRUE(std::any_of(covisible.begin(), covisible.end(),
                          [&](const Covisible& c) { return c.keyframe == plan.keyframe_a; }));
  options_.window_keyframes = static_cast<int>(covisible.size()) + 1;
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_LT(TrajectoryError(), 0.1 * before);
}

// The drift that a loop takes out is taken out of the marks, too: each keeps its place before the keyframe that saw it.
TEST_F(LoopTest, MarksFollowTheirKeyframesAndTheirScale) {
  BuildDriftingMap();
  const MergePlan plan = Plan(2 * kTurn - 2, 1);
  std::vector<MarkHandle> marks;
  const Eigen::Vector3d before_camera(0.3, -0.4, 1.1);
  for (const auto& [label, frame] : {std::pair("early", 3), std::pair("turn", kTurn), std::pair("late", 50)}) {
    const Keyframe& keyframe_of_mark = atlas_.keyframe(keyframe(frame));
    Mark mark;
    mark.label = MarkLabel::From(label).value();
    PlacedMark place;
    place.map = keyframe_of_mark.map;
    place.position = keyframe_of_mark.cam_from_map.Inverse() * before_camera;
    place.normal = Eigen::Vector3d::UnitX();
    place.radius = 0.1;
    marks.push_back(atlas_.AddMark(mark, keyframe(frame), place));
  }
  const Atlas before = atlas_;
  ASSERT_TRUE(Apply(plan).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  double largest_growth = 1.0;
  for (const MarkHandle handle : marks) {
    const Mark& mark = atlas_.marks().At(handle);
    const double growth = atlas_.KeyframeScale(mark.keyframe) / before.KeyframeScale(mark.keyframe);
    largest_growth = std::max({largest_growth, growth, 1.0 / growth});
    const Eigen::Vector3d in_camera = atlas_.keyframe(mark.keyframe).cam_from_map * atlas_.PlaceOf(mark).position;
    EXPECT_LT((in_camera - growth * before_camera).norm(), 1e-9);
    // Points before the same keyframe have come along as well: the mark lies among them as it did.
    double sum = 0.0;
    int num = 0;
    const Keyframe& then = before.keyframe(mark.keyframe);
    for (int i = 0; i < then.features.num; ++i) {
      const MapPoint* old_point = before.GetPoint(then.points[i]);
      const MapPoint* point = atlas_.GetPoint(then.points[i]);
      if (old_point == nullptr || point == nullptr) continue;
      const double old_distance = (old_point->position - before.PlaceOf(before.marks().At(handle)).position).norm();
      sum += (point->position - atlas_.PlaceOf(mark).position).norm() / (growth * old_distance);
      ++num;
    }
    ASSERT_GT(num, 50);
    EXPECT_NEAR(sum / num, 1.0, 0.05);
  }
  EXPECT_GT(largest_growth, 1.02);
}

// Neighbours that share a node take the drift out nearly as well as keyframes one by one.
TEST_F(LoopTest, DriftIsTakenOutInGroups) {
  BuildDriftingMap();
  const double before = TrajectoryError();
  options_.graph_max_nodes = 12;
  ASSERT_TRUE(Apply(Plan(2 * kTurn - 2, 1)).ok());
  EXPECT_EQ(CheckInvariants(atlas_).ToString(), "ok");
  EXPECT_LE(outcome_.num_graph_nodes, 12 + 16 + 4);
  EXPECT_LT(TrajectoryError(), 0.5 * before);
}

// The graph of a long procedure is no larger than that of a short one, and still spreads the correction.
TEST(LongLoop, GraphIsBoundedAndDriftIsTakenOut) {
  constexpr int kLongTurn = 400;
  SyntheticColon colon(5, 2 * kLongTurn);
  Atlas atlas = colon.MakeAtlas();
  colon.AddWall(0.0, 0.06 * kLongTurn + 3.0, 7000);
  const MapHandle map = atlas.CreateMap();
  Sim3 drifted_from_world;
  for (int i = 0; i < 2 * kLongTurn; ++i) {
    const double z = i < kLongTurn ? 0.06 * i : 0.06 * (2 * kLongTurn - 1 - i) + 0.02;
    const SE3 view = colon.ViewFrom(z);
    colon.AddKeyframe(&atlas, map, view, drifted_from_world);
    const Eigen::Vector3d centre = drifted_from_world * view.InverseTranslation();
    const Sim3 to_camera(1.0, Eigen::Quaterniond::Identity(), -centre);
    const Sim3 slip(1.0002, ExpSO3({0.0001, -0.00005, 0.00005}), {0.0003, 0.0002, -0.0003});
    drifted_from_world = to_camera.Inverse() * slip * to_camera * drifted_from_world;
  }
  colon.AddPoints(&atlas, 0, 2 * kLongTurn, 0.003, [](int frame, int landmark) {
    return frame < kLongTurn || (frame < kLongTurn + 6 && landmark % 2 == 0) ? 0 : 1;
  });
  // At the far end of the loop, where the map began.
  const auto gap = [&] {
    const Keyframe &first = atlas.keyframe(colon.frames()[1].keyframe),
                   &last = atlas.keyframe(colon.frames()[2 * kLongTurn - 2].keyframe);
    const SE3 truth = colon.frames()[2 * kLongTurn - 2].cam_from_world * colon.frames()[1].cam_from_world.Inverse();
    return ((last.cam_from_map * first.cam_from_map.Inverse()).InverseTranslation() - truth.InverseTranslation())
        .norm();
  };
  const NoiseModel noise{colon.config().noise};
  const CommonAreaConfig common_area;
  CommonAreaVerifier verifier(colon.config(), common_area, noise, colon.camera(), colon.scene(), colon.device());
  CommonArea area;
  Rng rng(4);
  ASSERT_TRUE(colon.Verify(verifier, atlas, colon.frames()[2 * kLongTurn - 2].keyframe, colon.frames()[1].keyframe, rng,
                           &area));
  const double before = gap();
  SchurBundleAdjuster adjuster;
  const MergingConfig options;
  Merger merger(colon.config(), options, noise, colon.camera(), colon.device(), adjuster);
  const MergePlan plan = MakeMergePlan(area);
  ASSERT_TRUE(merger.Begin(plan, atlas).ok());
  ASSERT_TRUE(merger.Step({}, plan.keyframe_a, &atlas).ok());
  const MergeOutcome& outcome = merger.outcome();
  EXPECT_EQ(CheckInvariants(atlas).ToString(), "ok");
  EXPECT_LE(outcome.num_graph_nodes, options.graph_max_nodes + 4 * options.window_keyframes);
  EXPECT_GT(before, 0.2);
  EXPECT_LT(gap(), 0.05);
  // Neighbours are where they were beside each other: the map is not torn between groups.
  double largest = 0.0;
  for (int i = 1; i < 2 * kLongTurn; ++i) {
    const SE3 relative = atlas.keyframe(colon.frames()[i].keyframe).cam_from_map *
                         atlas.keyframe(colon.frames()[i - 1].keyframe).cam_from_map.Inverse();
    const SE3 truth = colon.frames()[i].cam_from_world * colon.frames()[i - 1].cam_from_world.Inverse();
    largest = std::max(largest, (relative.InverseTranslation() - truth.InverseTranslation()).norm());
  }
  EXPECT_LT(largest, 0.05);
}

// A loop is closed, or it is not: wherever the time runs out, the map is as it was or its drift is gone. What is closed
// keeps its observations unless the weld was finished.
TEST_F(LoopTest, TimeMayRunOutAnywhere) {
  RecordProperty("req", "MRG-001");
  BuildDriftingMap();
  const double drift = TrajectoryError();
  const MergePlan plan = Plan(2 * kTurn - 2, 1);
  const Atlas before = atlas_;
  const int num_observations = NumObservations(before);
  int num_open = 0;
  bool is_finished = false;
  for (int num_looks = 0; num_looks < 300 && !is_finished; num_looks += num_looks < 110 ? 10 : 1) {
    SCOPED_TRACE(num_looks);
    atlas_ = before;
    const Status status = ApplyStopped(plan, num_looks, &atlas_);
    ASSERT_EQ(CheckInvariants(atlas_).ToString(), "ok");
    if (!status.ok()) {
      ++num_open;
      EXPECT_EQ(status.code(), StatusCode::kDeadlineExceeded);
      ExpectUntouched(before);
      continue;
    }
    EXPECT_LT(TrajectoryError(), 0.5 * drift);
    is_finished = outcome_.weld_state == SolveState::kConverged;
    if (!is_finished) {
      EXPECT_GE(NumObservations(atlas_), num_observations);
    }
  }
  EXPECT_GT(num_open, 0);
  EXPECT_TRUE(is_finished);
}

// A graph that was still moving would tear the map at the seam.
TEST_F(LoopTest, GraphThatRanOutOfIterationsLeavesTheLoopOpen) {
  BuildDriftingMap();
  options_.graph_iterations = 1;
  const Atlas before = atlas_;
  ASSERT_EQ(Apply(Plan(2 * kTurn - 2, 1)).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(outcome_.graph_state, SolveState::kPartial);
  EXPECT_FALSE(outcome_.has_moved);
  ExpectUntouched(before);
}

TEST_F(LoopTest, FramesFollowTheirKeyframesAndTheirScale) {
  BuildDriftingMap();
  const Tracked tracked = Track(kTurn + 20);
  ResolvedPose before, after;
  ASSERT_TRUE(atlas_.Resolve(tracked.reference, tracked.cam_from_reference, tracked.scale, &before));
  ASSERT_TRUE(Apply(Plan(2 * kTurn - 2, 1)).ok());
  ASSERT_TRUE(atlas_.Resolve(tracked.reference, tracked.cam_from_reference, tracked.scale, &after));
  const KeyframeHandle reference = keyframe(kTurn + 20);
  const SE3 relative = after.cam_from_map * atlas_.keyframe(reference).cam_from_map.Inverse();
  const double growth = atlas_.KeyframeScale(reference) / tracked.scale;
  EXPECT_NEAR(relative.translation.norm(), growth * tracked.cam_from_reference.translation.norm(), 1e-9);
  // The map had grown on its way by a fifth; the loop takes that back.
  EXPECT_LT(growth, 0.97);
}

}  // namespace
}  // namespace haustra::test
