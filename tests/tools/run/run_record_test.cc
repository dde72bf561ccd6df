#include "tools/run/run_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

namespace haustra {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(40);

FrameOutcome Outcome(std::uint32_t index, TrackingState state, TrackingReason reason, MapId map_id = kNoId) {
  FrameOutcome outcome;
  outcome.result.frame_index = index;
  outcome.result.timestamp = TimePoint(index * kPeriod);
  outcome.result.state = state;
  outcome.result.reason = reason;
  outcome.result.map_id = map_id;
  return outcome;
}
FrameOutcome Tracked(std::uint32_t index, MapId map_id) {
  return Outcome(index, TrackingState::kTracking, TrackingReason::kTracked, map_id);
}
FrameOutcome Lost(std::uint32_t index) { return Outcome(index, TrackingState::kLost, TrackingReason::kFewInliers); }

std::vector<std::string> EventNames(const RunRecord& record) {
  std::vector<std::string> names;
  for (const RunEvent& event : record.events()) names.push_back(event.event);
  return names;
}

TEST(RunRecord, LossCountsOnceUntilTrackedAgain) {
  RunRecord record({});
  record.OnFrame(Outcome(0, TrackingState::kInitialising, TrackingReason::kFirstView));
  record.OnFrame(Tracked(1, 3));
  record.OnFrame(Lost(2));
  record.OnFrame(Lost(3));
  record.OnFrame(Tracked(4, 3));
  record.OnFrame(Lost(5));
  EXPECT_EQ(record.num_losses(), 2u);
  EXPECT_EQ(record.num_tracked(), 2u);
  ASSERT_EQ(EventNames(record), (std::vector<std::string>{"lost", "lost"}));
  EXPECT_EQ(record.events()[0].frame_index, 2u);
  EXPECT_EQ(record.events()[0].map_id, 3);
  EXPECT_EQ(record.events()[0].details, "few_inliers");
}

TEST(RunRecord, FramesBeforeTheFirstMapAreNoLoss) {
  RunRecord record({});
  record.OnFrame(Outcome(0, TrackingState::kInitialising, TrackingReason::kLowParallax));
  record.OnFrame(Outcome(1, TrackingState::kInitialising, TrackingReason::kMapProposed));
  EXPECT_EQ(record.num_losses(), 0u);
  EXPECT_TRUE(record.events().empty());
}

TEST(RunRecord, RelocalisationIsAnEventWithItsMap) {
  RunRecord record({});
  record.OnFrame(Tracked(0, 2));
  record.OnFrame(Lost(1));
  record.OnFrame(Outcome(2, TrackingState::kTracking, TrackingReason::kRelocalised, 2));
  record.OnFrame(Tracked(3, 2));
  EXPECT_EQ(record.num_relocalisations(), 1u);
  ASSERT_EQ(EventNames(record), (std::vector<std::string>{"lost", "relocalised"}));
  EXPECT_EQ(record.events()[1].frame_index, 2u);
  EXPECT_EQ(record.events()[1].map_id, 2);
}

TEST(RunRecord, DroppedAndDamagedFramesAreNeitherTrackedNorLosses) {
  RunRecord record({});
  record.OnFrame(Tracked(0, 0));
  FrameOutcome dropped = Lost(1);
  dropped.is_dropped = true;
  record.OnFrame(dropped);
  FrameOutcome damaged = Lost(2);
  damaged.is_damaged = true;
  record.OnDamagedFrame(2, "2.jpg: truncated");
  record.OnFrame(damaged);
  record.OnFrame(Tracked(3, 0));
  EXPECT_EQ(record.num_dropped(), 1u);
  EXPECT_EQ(record.num_damaged(), 1u);
  EXPECT_EQ(record.num_tracked(), 2u);
  EXPECT_EQ(record.num_losses(), 0u);
  ASSERT_EQ(EventNames(record), (std::vector<std::string>{"frame_damaged"}));
  EXPECT_EQ(record.events()[0].details, "2.jpg: truncated");
  EXPECT_EQ(record.events()[0].timestamp, TimePoint(2 * kPeriod));
}

TEST(RunRecord, LatePoseGoesToItsFrameOnly) {
  RunRecord record({});
  for (std::uint32_t i = 0; i < 3; ++i) {
    record.OnFrame(Outcome(i, TrackingState::kInitialising, TrackingReason::kLowParallax));
  }
  LatePose pose;
  pose.frame_index = 1;
  pose.reference_keyframe = 5;
  pose.cam_from_reference = SE3(Eigen::Quaterniond::Identity(), {0.1, 0.2, 0.3});
  pose.reference_scale = 2.0;
  pose.num_inliers = 77;
  record.OnLatePose(pose);
  EXPECT_EQ(record.frames()[0].result.reference_keyframe, kNoId);
  EXPECT_EQ(record.frames()[1].result.reference_keyframe, 5u);
  EXPECT_EQ(record.frames()[1].result.cam_from_reference.translation, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(record.frames()[1].result.reference_scale, 2.0);
  EXPECT_EQ(record.frames()[1].result.num_inliers, 77);
  EXPECT_EQ(record.frames()[2].result.reference_keyframe, kNoId);
}

TEST(RunRecord, MapEventsKeepTheirMapsAndCounts) {
  RunRecord record({});
  MapEvent created;
  created.kind = MapEventKind::kMapCreated;
  created.map_id = 4;
  created.num_keyframes = 2;
  created.num_points = 99;
  record.OnMapEvent(created);
  MapEvent merged;
  merged.kind = MapEventKind::kMerged;
  merged.map_id = 0;
  merged.other_map_id = 4;
  merged.place.num_inliers = 33;
  record.OnMapEvent(merged);
  ASSERT_EQ(EventNames(record), (std::vector<std::string>{"map_created", "merged"}));
  EXPECT_EQ(record.events()[0].map_id, 4);
  EXPECT_EQ(record.events()[0].other_map_id, -1);
  EXPECT_EQ(record.events()[0].details, "2 keyframes 99 points");
  EXPECT_EQ(record.events()[1].other_map_id, 4);
  EXPECT_NE(record.events()[1].details.find("inliers=33"), std::string::npos) << record.events()[1].details;
}

TEST(RunRecord, ProgressIsCalledAfterEveryFrame) {
  std::vector<std::size_t> counts;
  RunRecord record([&](const RunRecord& r) { counts.push_back(r.frames().size()); });
  record.OnFrame(Lost(0));
  record.OnFrame(Lost(1));
  EXPECT_EQ(counts, (std::vector<std::size_t>{1, 2}));
}

}  // namespace
}  // namespace haustra
