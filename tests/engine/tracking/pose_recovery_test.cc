// A wall seen again of which little looks as it did: most brute-force matches lead elsewhere. The truth is the pose
// from which the rest was projected.
#include "engine/tracking/pose_recovery.h"

#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "tests/engine/tracking/search_in_map.h"

namespace haustra::test {
namespace {

class PoseRecoveryTest : public SearchInMap {
 protected:
  static constexpr int kNumPoints = 200;

  // The map has kNumPoints points, and the frame shows all of them: so many in their places, the rest anywhere.
  void SeeWall(int num_true) {
    std::vector<Keypoint> in_map(kNumPoints);
    std::vector<std::uint8_t> descriptors;
    const FeatureSetHandle set = colon_.device().CreateFeatureSet().value();
    for (int i = 0; i < kNumPoints; ++i) {
      LocalPoint& point = map_.points[map_.num_points++];
      point.position = {rng_.Uniform(-0.8, 0.8), rng_.Uniform(-0.6, 0.6), rng_.Uniform(1.5, 3.0)};
      point.normal = -Eigen::Vector3d::UnitZ();
      point.scale_times_distance = kScalePx * point.position.norm();
      point.descriptor = {set, i};
      point.keyframe_mask = 0b111;
      point.established = TimePoint{};
      Show(point.position, &in_map[i]);
      const Eigen::Vector3d elsewhere(rng_.Uniform(-0.8, 0.8), rng_.Uniform(-0.6, 0.6), 2.0);
      Show(i < num_true ? wall_ * point.position : elsewhere, &frame_.features.keypoints[i]);
      const auto descriptor = EncodeAppearance({static_cast<std::uint32_t>(i + 1), static_cast<std::uint32_t>(i + 1)});
      descriptors.insert(descriptors.end(), descriptor.begin(), descriptor.end());
    }
    frame_.features.num = kNumPoints;
    frame_.features.set = colon_.device().CreateFeatureSet().value();
    const std::span in_frame(frame_.features.keypoints.data(), std::size_t{kNumPoints});
    ASSERT_TRUE(colon_.device().WriteFeatures(set, in_map, descriptors).ok());
    ASSERT_TRUE(colon_.device().WriteFeatures(frame_.features.set, in_frame, descriptors).ok());
    for (int i = 0; i < kNumPoints; ++i) {
      Eigen::Vector3d bearing;
      ASSERT_TRUE(colon_.camera().Unproject(frame_.features.pixel(i), &bearing));
      const Eigen::Vector3f rounded = bearing.cast<float>();
      frame_.features.bearings[i] = {rounded.x(), rounded.y(), rounded.z()};
    }
    PublishMap();
  }
  double Error() const { return (search_.estimate().cam_from_map.translation - wall_.translation).norm(); }

  PoseRecovery recovery_{parts_, search_};
  const SE3 wall_{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.0, 0.2)};
};

TEST_F(PoseRecoveryTest, AWallThatIsAllThereIsFound) {
  SeeWall(kNumPoints);
  EXPECT_EQ(recovery_.outcome(), SearchOutcome::kNotSearched);
  EXPECT_TRUE(recovery_.Recover(true));
  EXPECT_EQ(recovery_.outcome(), SearchOutcome::kFound);
  EXPECT_LT(Error(), 1e-3);
}

// Walls that are only alike agree in a few points as well. On living tissue true poses are refused for it, too
// (decisions/2026-11-28-a-share-of-matches.md).
TEST_F(PoseRecoveryTest, TheShareOfMatchesThatAgreeDecides) {
  const double share = config_.place.relocalisation.min_match_share;
  SeeWall(static_cast<int>(1.3 * share * kNumPoints));
  EXPECT_TRUE(recovery_.Recover(true));
  EXPECT_LT(Error(), 1e-2);
}

TEST_F(PoseRecoveryTest, FewThatAgreeAreNotEnough) {
  const int num_true = static_cast<int>(0.9 * config_.place.relocalisation.min_match_share * kNumPoints);
  ASSERT_GE(num_true, config_.tracking.min_recovery_inliers);
  SeeWall(num_true);
  EXPECT_FALSE(recovery_.Recover(true));
  EXPECT_EQ(recovery_.outcome(), SearchOutcome::kLowMatchShare);
}

TEST_F(PoseRecoveryTest, MatchesThatAllLeadElsewhereGiveNoPose) {
  SeeWall(0);
  EXPECT_FALSE(recovery_.Recover(true));
  EXPECT_EQ(recovery_.outcome(), SearchOutcome::kNoPose);
}

TEST_F(PoseRecoveryTest, AMapWithoutPointsMatchesNothing) {
  PublishMap();
  EXPECT_FALSE(recovery_.Recover(true));
  EXPECT_EQ(recovery_.outcome(), SearchOutcome::kFewMatches);
}

// Why the scope is not found again, frame by frame.
TEST(SearchOutcomes, ALostFrameSaysWhatItsSearchFailedAt) {
  ScriptedColon colon;
  colon.Move(0.0, 2.4, 60);
  colon.Occlude(2);
  colon.Move(12.0, 12.0, 3);
  colon.Move(2.4, 2.2, 5);
  const auto engine = colon.MakeEngine();
  std::vector<FrameResult> results;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    results.push_back(engine->Track(*frame, kNoDeadline));
    while (engine->BackgroundStep()) {
    }
  }
  ASSERT_EQ(results.size(), 70u);
  EXPECT_EQ(results[0].search, SearchOutcome::kNotSearched) << "there is no map";
  EXPECT_EQ(results[50].search, SearchOutcome::kNotSearched) << "it is tracked";
  EXPECT_EQ(results[61].reason, TrackingReason::kFewFeatures);
  EXPECT_EQ(results[61].search, SearchOutcome::kNotSearched) << "the picture shows nothing";
  for (int i = 62; i < 65; ++i) {
    EXPECT_EQ(results[i].state, TrackingState::kLost) << i;
    EXPECT_EQ(results[i].search, SearchOutcome::kFewMatches) << i << ": " << ToString(results[i].search);
  }
  ASSERT_EQ(results[65].reason, TrackingReason::kRelocalised);
  EXPECT_EQ(results[65].search, SearchOutcome::kFound);
}

}  // namespace
}  // namespace haustra::test
