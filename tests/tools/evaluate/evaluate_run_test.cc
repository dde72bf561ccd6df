#include "tools/evaluate/evaluate_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/synthetic_run.h"
#include "tools/evaluate/report_text.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// 400 frames: map 1 from 10 to 109 (0.2 mm off, alternately), map 2 from 200 to 299 (0.4 mm off), map 3 from 350 to
// 354.
RunOutput ThreeMaps() {
  RunOutput run;
  run.folder = "results/seed1";
  const auto off_by = [](std::int64_t i, double offset) {
    SE3 pose = TruePose(i);
    pose.translation.z() += i % 2 == 0 ? offset : -offset;
    return pose;
  };
  for (std::int64_t i = 0; i < 400; ++i) {
    const int map_id = i >= 10 && i < 110 ? 1 : i >= 200 && i < 300 ? 2 : i >= 350 && i < 355 ? 3 : -1;
    run.frames.push_back(MakeRunFrame(i, map_id, map_id, off_by(i, map_id == 1 ? 0.2 : 0.4)));
    run.frames.back().num_inliers = map_id == 1 ? 100 : 50;
  }
  run.maps = {{1, "stored", 20, 1000}, {2, "active", 10, 500}, {3, "stored", 4, 90}, {4, "dropped", 0, 0}};
  run.events = {Event(10, "map_created", 1), Event(110, "lost", 1), Event(200, "map_created", 2),
                Event(350, "map_created", 3)};
  return run;
}

TEST(EvaluateRun, CoverageIsLocalisedOverAllFrames) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  EXPECT_EQ(e.frames, 400u);
  EXPECT_EQ(e.localised, 205u);
  EXPECT_DOUBLE_EQ(e.coverage, 51.25);
  EXPECT_FALSE(e.visible_coverage.has_value());
}

TEST(EvaluateRun, VisibleCoverageLeavesOutWhatCannotBeSeen) {
  Reference reference = TrueReference(400);
  reference.events = std::vector<SequenceEvent>{{110, 199, "redout", false}, {300, 309, "nbi", true}};
  const Evaluation e = EvaluateRun(ThreeMaps(), reference, {});
  EXPECT_EQ(e.visible_frames, 310u);
  EXPECT_EQ(e.visible_localised, 205u);
  EXPECT_DOUBLE_EQ(*e.visible_coverage, 100.0 * 205 / 310);
}

TEST(EvaluateRun, LocalisedFramesThatCannotBeSeenDoNotRaiseTheVisibleCoverage) {
  Reference reference = TrueReference(400);
  reference.events = std::vector<SequenceEvent>{{0, 299, "water", false}};
  const Evaluation e = EvaluateRun(ThreeMaps(), reference, {});
  EXPECT_EQ(e.visible_localised, 5u);
  EXPECT_EQ(e.localised, 205u);
}

TEST(EvaluateRun, LiveCoverageCountsOnlyWhatWasAnsweredAtTheTime) {
  RunOutput run = ThreeMaps();
  // The first five frames of map 1 were placed when it stood.
  for (std::int64_t i = 10; i < 15; ++i) run.frames[static_cast<std::size_t>(i)].live_map_id = -1;
  // Frames that were answered in a map that is gone, and one that has lost its final pose since.
  for (std::int64_t i = 150; i < 160; ++i) run.frames[static_cast<std::size_t>(i)].live_map_id = 4;
  run.frames[20].map_id = -1;
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(e.live_localised, 200u);
  EXPECT_DOUBLE_EQ(e.live_coverage, 50.0);
  EXPECT_EQ(e.localised, 204u);
  EXPECT_FALSE(e.live_visible_coverage.has_value());
}

TEST(EvaluateRun, MapThatBecamePartOfAnotherLastsAsLongAsThatDoes) {
  // Answered in map 5, which was merged into 6, and 6 into 2.
  RunOutput run = ThreeMaps();
  for (std::int64_t i = 200; i < 300; ++i) run.frames[static_cast<std::size_t>(i)].live_map_id = 5;
  const auto live = [&] { return EvaluateRun(run, TrueReference(400), {}).live_localised; };
  EXPECT_EQ(live(), 105u);
  run.events.push_back(Event(300, "merged", 6, 5));
  EXPECT_EQ(live(), 105u);
  run.events.push_back(Event(310, "merged", 2, 6));
  EXPECT_EQ(live(), 205u);
  // The same by maps.csv alone.
  run.events.clear();
  run.maps.push_back({5, "merged", 0, 0, 6});
  run.maps.push_back({6, "merged", 0, 0, 2});
  EXPECT_EQ(live(), 205u);
  run.maps[1].status = "dropped";
  EXPECT_EQ(live(), 105u);
}

TEST(EvaluateRun, FramesThatTheRunNeverReachedAreNotLocalised) {
  RunOutput run = ThreeMaps();
  run.frames.erase(run.frames.begin() + 120, run.frames.begin() + 140);
  run.figures.sequence_frames = 500;
  Reference reference = TrueReference(500);
  // 10 of those in the gap and 30 of those after the end cannot be seen.
  reference.events = std::vector<SequenceEvent>{{130, 139, "redout", false}, {450, 479, "redout", false}};
  const Evaluation e = EvaluateRun(run, reference, {});
  EXPECT_EQ(e.frames, 500u);
  EXPECT_EQ(e.unanswered_frames, 120u);
  EXPECT_DOUBLE_EQ(e.live_coverage, 41.0);
  EXPECT_DOUBLE_EQ(e.coverage, 41.0);
  EXPECT_EQ(e.visible_frames, 460u);
  EXPECT_DOUBLE_EQ(*e.live_visible_coverage, 100.0 * 205 / 460);
  EXPECT_DOUBLE_EQ(*e.visible_coverage, 100.0 * 205 / 460);
  // The same when the events are found by time, whether or not the run used every frame.
  for (std::int64_t i = 0; i < 500; ++i) reference.frame_stamps_ns.push_back(i * kPeriodNs);
  EXPECT_EQ(EvaluateRun(run, reference, {}).visible_frames, 460u);
  for (std::int64_t i = 500; i < 510; ++i) reference.frame_stamps_ns.push_back(i * kPeriodNs);
  EXPECT_EQ(EvaluateRun(run, reference, {}).visible_frames, 460u);
}

// As the header of a damaged video may claim.
TEST(EvaluateRun, FramesThatWereNeverReachedCostNoMemory) {
  RunOutput run = ThreeMaps();
  run.figures.sequence_frames = std::int64_t{1} << 60;
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(e.unanswered_frames, (std::size_t{1} << 60) - 400);
  EXPECT_GT(e.coverage, 0.0);
}

TEST(EvaluateRun, WhyThereIsNoErrorIsSaid) {
  RunOutput run = ThreeMaps();
  const std::string without_truth = ToText(EvaluateRun(run, {}, {}));
  EXPECT_THAT(without_truth, HasSubstr("RMS ATE           -   (there is no true pose of any frame)\n"));
  EXPECT_THAT(without_truth, Not(HasSubstr("left out")));

  for (RunFrame& frame : run.frames) frame.world_from_cam.translation = {0.01 * double(frame.frame_idx), 0.0, 0.0};
  EXPECT_THAT(ToText(EvaluateRun(run, TrueReference(400), {})),
              HasSubstr("RMS ATE           -   (the paths of all maps with 10 frames lie on a line)\n"));

  for (RunFrame& frame : run.frames) {
    if (frame.map_id != 3) frame.map_id = -1;
  }
  const std::string too_few = ToText(EvaluateRun(run, TrueReference(400), {}));
  EXPECT_THAT(too_few, HasSubstr("RMS ATE           -   (no map has 10 localised frames with a true pose)\n"));
  EXPECT_THAT(too_few, HasSubstr("left out: 1 map with too few true poses or on a line, 5 localised frames in all"));
}

TEST(EvaluateRun, LiveVisibleCoverageLeavesOutWhatCannotBeSeen) {
  RunOutput run = ThreeMaps();
  for (std::int64_t i = 10; i < 30; ++i) run.frames[static_cast<std::size_t>(i)].live_map_id = -1;
  Reference reference = TrueReference(400);
  reference.events = std::vector<SequenceEvent>{{0, 19, "redout", false}};
  const Evaluation e = EvaluateRun(run, reference, {});
  EXPECT_EQ(e.visible_localised, 195u);
  EXPECT_EQ(e.live_visible_localised, 185u);
  EXPECT_DOUBLE_EQ(*e.live_visible_coverage, 100.0 * 185 / 380);
}

TEST(EvaluateRun, ErrorsArePooledOverFramesEachMapWithItsOwnSim3) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  ASSERT_EQ(e.per_map.size(), 3u);
  EXPECT_NEAR(*e.per_map[0].rms_ate, 0.2, 0.01);
  EXPECT_NEAR(*e.per_map[1].rms_ate, 0.4, 0.02);
  EXPECT_NEAR(*e.rms_ate, std::sqrt((0.04 + 0.16) / 2), 0.015);
  EXPECT_NEAR(*e.max_error, 0.4, 0.05);
  EXPECT_NEAR(*e.per_map[0].scale, 1.0 / MapFromWorld(1).scale, 0.2);
  EXPECT_NEAR(*e.per_map[1].scale_drift, 1.0, 0.2);
}

TEST(EvaluateRun, SmallMapsAreLeftOutOfTheErrorAndReported) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  EXPECT_EQ(e.maps, 3u);
  EXPECT_EQ(e.left_out_maps, 1u);
  EXPECT_EQ(e.left_out_frames, 5u);
  EXPECT_EQ(e.ate_frames, 200u);
  EXPECT_FALSE(e.per_map[2].rms_ate.has_value());
  EXPECT_EQ(e.largest_map_frames, 100u);
}

TEST(EvaluateRun, PapersTableFollowsFromFramesAndMaps) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  EXPECT_DOUBLE_EQ(e.per_map[0].life_time_s, 4.0);
  EXPECT_DOUBLE_EQ(e.per_map[0].keyframes_per_s, 5.0);
  EXPECT_DOUBLE_EQ(e.per_map[0].observations_per_frame, 100.0);
  EXPECT_DOUBLE_EQ(e.per_map[0].observations_per_point, 10.0);  // 100 frames x 100 points / 1000 points
  EXPECT_EQ(e.keyframes, 34u);
  EXPECT_EQ(e.map_points, 1590u);
  ASSERT_TRUE(e.mean_map && e.largest_map);
  EXPECT_NEAR(e.mean_map->keyframes, 34.0 / 3, 1e-9);
  EXPECT_NEAR(e.mean_map->keyframes_per_s, (5.0 + 2.5 + 20.0) / 3, 1e-9);
  EXPECT_DOUBLE_EQ(e.largest_map->map_points, 1000.0);
}

TEST(EvaluateRun, EventsAreCounted) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  EXPECT_EQ(e.maps_created, 3u);
  EXPECT_EQ(e.losses, 1u);
  EXPECT_EQ(e.merges.made, 0u);
  EXPECT_EQ(e.false_merges, 0u);
}

TEST(EvaluateRun, GroundTruthIsMatchedByNearestStampWithinHalfAPeriod) {
  Reference reference = TrueReference(400);
  for (GroundTruthPose& pose : reference.poses) pose.timestamp_ns += 15000000;
  EXPECT_EQ(EvaluateRun(ThreeMaps(), reference, {}).frames_without_groundtruth, 0u);
  // Every second pose is missing: a neighbour is a whole period away.
  Reference sparse = TrueReference(400);
  std::size_t i = 0;
  std::erase_if(sparse.poses, [&](const GroundTruthPose&) { return i++ % 2 == 1; });
  const Evaluation e = EvaluateRun(ThreeMaps(), sparse, {});
  EXPECT_EQ(e.frames_without_groundtruth, 200u);
  EXPECT_EQ(e.localised, 205u);
  EXPECT_EQ(e.ate_frames, 100u);
}

TEST(EvaluateRun, FramesWhileMapsAreJoinedAreTimedApart) {
  RunOutput run = ThreeMaps();
  for (RunFrame& frame : run.frames) frame.frame_ms = 10.0;
  // 100 ms of joining, over when frame 60 was the newest: frames 58 to 60, at 25 Hz three periods before, one after.
  run.times = {{60, "merging/total", 100.0}, {200, "mapping/total", 80.0}};
  for (std::int64_t i = 57; i <= 61; ++i) run.frames[static_cast<std::size_t>(i)].frame_ms = 30.0;
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  ASSERT_TRUE(e.joining_frame_ms && e.other_frame_ms);
  EXPECT_EQ(e.joining_frames, 5u);
  EXPECT_DOUBLE_EQ(e.joining_frame_ms->p50, 30.0);
  EXPECT_DOUBLE_EQ(e.other_frame_ms->max, 10.0);
  // Twice as fast, they are five periods.
  run.figures.rate = 2.0;
  EXPECT_EQ(EvaluateRun(run, TrueReference(400), {}).joining_frames, 7u);
  run.figures.rate.reset();
  // Lost frames are not compared.
  run.frames[60].live_map_id = run.frames[70].live_map_id = -1;
  run.frames[60].frame_ms = run.frames[70].frame_ms = 500.0;
  const Evaluation with_lost = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(with_lost.joining_frames, 4u);
  EXPECT_DOUBLE_EQ(with_lost.joining_frame_ms->max, 30.0);
  EXPECT_DOUBLE_EQ(with_lost.other_frame_ms->max, 10.0);
  // Nothing was joined: nothing to compare.
  run.times.clear();
  EXPECT_FALSE(EvaluateRun(run, TrueReference(400), {}).joining_frame_ms.has_value());
}

TEST(EvaluateRun, StampsOfAnotherClockGiveAWarning) {
  Reference reference = TrueReference(400);
  for (GroundTruthPose& pose : reference.poses) pose.timestamp_ns += 1700000000000000000;
  const Evaluation e = EvaluateRun(ThreeMaps(), reference, {});
  EXPECT_FALSE(e.rms_ate.has_value());
  ASSERT_FALSE(e.warnings.empty());
  EXPECT_THAT(e.warnings[0], HasSubstr("time stamps"));
}

TEST(EvaluateRun, EventsOfTheSequenceAreFoundWhenTheRunUsedEverySecondFrame) {
  RunOutput run;
  for (std::int64_t i = 0; i < 50; ++i) {
    run.frames.push_back(MakeRunFrame(i, -1, -1, SE3()));
    run.frames.back().timestamp_ns = 2 * i * kPeriodNs;
  }
  Reference reference = TrueReference(100);
  reference.events = std::vector<SequenceEvent>{{60, 79, "redout", false}, {160, 179, "redout", false}};
  for (std::int64_t i = 0; i < 100; ++i) reference.frame_stamps_ns.push_back(i * kPeriodNs);
  EXPECT_EQ(EvaluateRun(run, reference, {}).visible_frames, 40u);
  // Of a video nobody knows them, but the run says which frames it has read.
  reference.frame_stamps_ns.clear();
  run.figures.part.every_nth = 2;
  EXPECT_EQ(EvaluateRun(run, reference, {}).visible_frames, 40u);
  run.figures.part.first_frame = 50;
  run.figures.sequence_frames = 60;  // the last ten of which it did not reach: frames 150 and on
  EXPECT_EQ(EvaluateRun(run, reference, {}).visible_frames, 45u);
}

TEST(EvaluateRun, LatencyOfARealTimeRunComesFromItsFrames) {
  RunOutput run = ThreeMaps();
  for (std::size_t i = 0; i < run.frames.size(); ++i) run.frames[i].frame_ms = 10.0 + 0.1 * static_cast<double>(i);
  run.frames[7].is_dropped = true;
  run.frames[8].is_damaged = true;
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  ASSERT_TRUE(e.frame_ms.has_value());
  EXPECT_DOUBLE_EQ(e.frame_ms->max, 49.9);
  EXPECT_DOUBLE_EQ(*e.deadline_ms, 40.0);
  EXPECT_EQ(e.deadline_misses, 99u);
  EXPECT_EQ(e.dropped, 1u);
  EXPECT_EQ(e.damaged, 1u);
}

TEST(EvaluateRun, ADeadlineIsThePeriodAtThePaceOfTheRun) {
  RunOutput run = ThreeMaps();
  for (std::size_t i = 0; i < run.frames.size(); ++i) run.frames[i].frame_ms = 0.1 * static_cast<double>(i);
  const Evaluation at_the_cameras_pace = EvaluateRun(run, TrueReference(400), {});
  run.figures.rate = 2.0;
  const Evaluation twice_as_fast = EvaluateRun(run, TrueReference(400), {});
  EXPECT_DOUBLE_EQ(*at_the_cameras_pace.deadline_ms, 40.0);
  EXPECT_DOUBLE_EQ(*twice_as_fast.deadline_ms, 20.0);
  EXPECT_GT(*twice_as_fast.deadline_misses, *at_the_cameras_pace.deadline_misses);
}

TEST(EvaluateRun, TimesOfASequentialRunComeFromItsSummary) {
  RunOutput run = ThreeMaps();
  run.figures.frame_ms = Percentiles{20, 30, 40, 50};
  run.figures.realtime_ratio = 1.5;
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(e.frame_ms->p999, 40.0);
  EXPECT_FALSE(e.deadline_misses.has_value());
  EXPECT_EQ(e.realtime_ratio, 1.5);
}

TEST(EvaluateRun, StageTimesAreThoseOfTheSamples) {
  RunOutput run = ThreeMaps();
  for (const double ms : {40.0, 10.0, 100.0, 20.0, 30.0}) run.times.push_back({0, "mapping/bundle", ms});
  run.times.push_back({0, "tracking/total", 7.0});
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  ASSERT_EQ(e.stages.size(), 2u);
  const StageEvaluation& bundle = e.stages[0];
  EXPECT_EQ(bundle.stage, "mapping/bundle");
  EXPECT_EQ(bundle.count, 5u);
  EXPECT_EQ(bundle.p50, 30.0);
  EXPECT_EQ(bundle.p99, 100.0);
  EXPECT_EQ(bundle.max, 100.0);
  EXPECT_EQ(bundle.mean, 40.0);
  EXPECT_NEAR(bundle.deviation, std::sqrt(1250.0), 1e-12);  // (0 + 900 + 3600 + 400 + 100) / 4
  EXPECT_EQ(e.stages[1].deviation, 0.0);
}

TEST(EvaluateRun, WithoutGroundTruthTheRestIsStillKnown) {
  const Evaluation e = EvaluateRun(ThreeMaps(), Reference(), {});
  EXPECT_DOUBLE_EQ(e.coverage, 51.25);
  EXPECT_EQ(e.keyframes, 34u);
  EXPECT_FALSE(e.rms_ate.has_value());
  EXPECT_FALSE(e.merge_recall.has_value());
  EXPECT_TRUE(e.warnings.empty());
}

// Maps 1 and 2 of ThreeMaps see different places; 5 is made where 1 was, and merged with it.
RunOutput MergedRun(const Sim3& displace) {
  RunOutput run = ThreeMaps();
  for (std::int64_t i = 220; i < 300; ++i) {
    RunFrame& frame = run.frames[static_cast<std::size_t>(i)];
    frame = MakeRunFrame(i, 5, 1, Moved(displace, TruePose(i)));
  }
  run.events.push_back(Event(299, "merged", 1, 5));
  MapGeometry geometry;
  geometry.camera = WideCamera();
  geometry.depth_mu = kDepth * MapFromWorld(1).scale;
  run.geometry[1] = geometry;
  return run;
}

TEST(EvaluateRun, TrueMergeIsCountedAndNotFlagged) {
  const Evaluation e = EvaluateRun(MergedRun(Sim3()), TrueReference(400), {});
  EXPECT_EQ(e.merges.made, 1u);
  EXPECT_EQ(e.merges.judged, 1u);
  EXPECT_EQ(e.false_merges, 0u);
  EXPECT_EQ(e.merges.precision(), 1.0);
  EXPECT_NEAR(*e.scene_depth, kDepth, 0.5);
  ASSERT_TRUE(e.merge_recall.has_value());
  EXPECT_GE(e.merge_recall->taken, 1u);
}

TEST(EvaluateRun, JoinsHaveTheDurationsThatWereMeasuredForThem) {
  RunOutput run = MergedRun(Sim3());
  run.events.push_back(Event(300, "relocalised", 1));
  run.times = {{299, "tracking/total", 20.0}, {301, "merging/total", 150.0}, {300, "tracking/total", 33.0}};
  Evaluation e = EvaluateRun(run, TrueReference(400), {});
  ASSERT_EQ(e.joins.size(), 2u);
  EXPECT_EQ(e.joins[0].duration_ms, 150.0);
  EXPECT_EQ(e.joins[1].duration_ms, 33.0);
  // One more duration than merges: which one belongs to which is not known.
  run.times.push_back({310, "merging/total", 99.0});
  e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_FALSE(e.joins[0].duration_ms.has_value());
}

TEST(EvaluateRun, ErrorOfAMapIsAShareOfItsOwnDepth) {
  RunOutput run = ThreeMaps();
  for (const int map_id : {1, 2}) {
    run.geometry[map_id].camera = WideCamera();
    run.geometry[map_id].depth_mu = map_id * kDepth * MapFromWorld(map_id).scale;
  }
  run.frames[10].map_id = -1;  // map 2 is the largest
  const Evaluation e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_NEAR(*e.per_map[0].scene_depth, kDepth, 0.5);
  EXPECT_NEAR(*e.per_map[0].rms_ate_percent_of_depth, 100.0 * 0.2 / kDepth, 0.05);
  EXPECT_NEAR(*e.per_map[1].scene_depth, 2.0 * kDepth, 1.0);
  EXPECT_NEAR(*e.per_map[1].rms_ate_percent_of_depth, 100.0 * 0.4 / (2.0 * kDepth), 0.05);
  EXPECT_FALSE(e.per_map[2].rms_ate_percent_of_depth.has_value());
  EXPECT_EQ(e.largest_map_rms_ate, e.per_map[1].rms_ate);
  EXPECT_EQ(e.largest_map_rms_ate_percent_of_depth, e.per_map[1].rms_ate_percent_of_depth);
  EvaluateOptions options;
  options.scene_depth = 40.0;
  const Evaluation given = EvaluateRun(run, TrueReference(400), options);
  EXPECT_NEAR(*given.per_map[1].rms_ate_percent_of_depth, 1.0, 0.05);
}

TEST(EvaluateRun, PosesFoundByBruteForceAreJudged) {
  RunOutput run = ThreeMaps();
  run.frames[60].reason = "recovered";
  run.times = {{60, "tracking/total", 33.0}, {70, "merging/total", 150.0}};
  Evaluation e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(e.recoveries.made, 1u);
  EXPECT_EQ(e.recoveries.wrong, 0u);
  EXPECT_EQ(e.relocalisations.made, 0u);
  ASSERT_EQ(e.joins.size(), 1u);
  EXPECT_EQ(e.joins[0].duration_ms, 33.0);
  // From there on the map is displaced.
  for (std::int64_t i = 60; i < 110; ++i) {
    SE3 believed = TruePose(i);
    believed.translation.z() += 20.0;
    run.frames[static_cast<std::size_t>(i)].world_from_cam = Moved(MapFromWorld(1), believed);
  }
  e = EvaluateRun(run, TrueReference(400), {});
  EXPECT_EQ(e.recoveries.wrong, 1u);
  EXPECT_EQ(e.false_merges, 1u);
}

TEST(EvaluateRun, FalseMergeIsFlagged) {
  const Sim3 displace(1.0, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 20));
  const Evaluation e = EvaluateRun(MergedRun(displace), TrueReference(400), {});
  EXPECT_EQ(e.false_merges, 1u);
  EXPECT_EQ(e.merges.precision(), 0.0);
  ASSERT_EQ(e.joins.size(), 1u);
  EXPECT_EQ(e.joins[0].verdict, Verdict::kFalse);
}

TEST(EvaluateRun, WithoutMapExportRecallIsNotKnownAndSaidSo) {
  const Evaluation e = EvaluateRun(ThreeMaps(), TrueReference(400), {});
  EXPECT_FALSE(e.merge_recall.has_value());
  EXPECT_FALSE(e.scene_depth.has_value());
  ASSERT_EQ(e.warnings.size(), 1u);
  EXPECT_THAT(e.warnings[0], HasSubstr("recall is not known"));
}

TEST(EvaluateRun, DepthOfTheKeyframeGoesBeforeThatOfTheMap) {
  RunOutput run = MergedRun(Sim3());
  run.geometry[1].keyframe_depth_mu[7] = 3.0 * kDepth * MapFromWorld(1).scale;
  for (RunFrame& frame : run.frames) frame.keyframe_id = 7;
  EXPECT_NEAR(*EvaluateRun(run, TrueReference(400), {}).scene_depth, 3.0 * kDepth, 1.5);
  EvaluateOptions options;
  options.scene_depth = 25.0;
  EXPECT_EQ(EvaluateRun(run, TrueReference(400), options).scene_depth, 25.0);
}

TEST(EvaluateRun, RunWithoutAnyMapIsEvaluatedToo) {
  RunOutput run;
  for (std::int64_t i = 0; i < 20; ++i) run.frames.push_back(MakeRunFrame(i, -1, -1, SE3()));
  const Evaluation e = EvaluateRun(run, TrueReference(20), {});
  EXPECT_EQ(e.coverage, 0.0);
  EXPECT_EQ(e.maps, 0u);
  EXPECT_FALSE(e.rms_ate.has_value());
  EXPECT_FALSE(e.mean_map.has_value());
}

}  // namespace
}  // namespace haustra::evaluate
