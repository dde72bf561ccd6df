// What is followed while a map is being made: a founding takes its matches to err each by itself, and must see nothing
// that was followed; the map that it gives is to be found in the next frame.
#include "tests/engine/tracking/tracker_with_mapper.h"

namespace haustra::test {
namespace {

class FoundingFollowTest : public TrackerWithMapper {
 protected:
  // Up to the second view of a new map, which the mapper has not yet seen.
  void TrackUntilProposed() {
    for (int i = 0; i < 60; ++i) {
      const FrameResult result = TrackNext();
      EXPECT_TRUE(device_.followed.empty()) << "before a map, frame " << i;
      if (result.reason == TrackingReason::kMapProposed) return;
      Map();
    }
    FAIL() << "no map was proposed";
  }

  // Of what waits for the mapper. It may have been asked for the place of the frame before.
  const KeyframeProposal& founding() {
    while (link_.proposals.Front()->kind != ProposalKind::kFounding) mapper_.Step();
    return *link_.proposals.Front();
  }
};

TEST_F(FoundingFollowTest, FromTheSecondViewOnThePointsOfTheMapComeFirst) {
  ASSERT_NO_FATAL_FAILURE(TrackUntilProposed());
  const KeyframeProposal& proposal = founding();
  std::vector<Keypoint> points;
  for (int i = 0; i < proposal.num_pairs; ++i) {
    points.push_back(proposal.view.features.keypoints[proposal.pairs[i].feature]);
  }
  const auto num_features = static_cast<std::size_t>(proposal.view.features.num);
  Map();
  EXPECT_EQ(TrackNext().state, TrackingState::kTracking);
  ASSERT_EQ(device_.followed.size(), num_features);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(device_.followed[i].x_px, points[i].x_px);
    EXPECT_EQ(device_.followed[i].y_px, points[i].y_px);
  }
}

TEST_F(FoundingFollowTest, GoesOnWhileTheMapperIsBusy) {
  ASSERT_NO_FATAL_FAILURE(TrackUntilProposed());
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(TrackNext().reason, TrackingReason::kAwaitingMap);
    EXPECT_FALSE(device_.followed.empty());
  }
  Map();
  EXPECT_EQ(TrackNext().state, TrackingState::kTracking);
  EXPECT_FALSE(device_.followed.empty());
}

TEST_F(FoundingFollowTest, EndsWhenTheMapIsRefused) {
  ASSERT_NO_FATAL_FAILURE(TrackUntilProposed());
  EXPECT_EQ(TrackNext().reason, TrackingReason::kAwaitingMap);
  link_.replies.TryPush({0, MapRefused{founding().founding_id}});
  EXPECT_EQ(ToString(TrackNext().reason), "first_view") << "the next founding begins";
  EXPECT_TRUE(device_.followed.empty());
}

// The device fails, or has no feature set for the frame: then it has not seen the picture, and the one before counts.
TEST_F(FoundingFollowTest, AFrameWithoutFeaturesIsNotFollowed) {
  ASSERT_NO_FATAL_FAILURE(TrackUntilProposed());
  for (bool FollowWatch::*what : {&FollowWatch::sees, &FollowWatch::has_room}) {
    EXPECT_EQ(TrackNext().reason, TrackingReason::kAwaitingMap);
    const std::int32_t num_free = device_.num_free_feature_sets();
    device_.*what = false;
    EXPECT_EQ(TrackNext().reason, TrackingReason::kDamagedFrame);
    EXPECT_EQ(device_.num_free_feature_sets(), num_free + 1) << "that of the frame before it";
    EXPECT_EQ(TrackNext().reason, TrackingReason::kAwaitingMap);
    EXPECT_EQ(device_.followed.empty(), what == &FollowWatch::sees);
  }
  Map();
  EXPECT_EQ(TrackNext().state, TrackingState::kTracking);
}

TEST_F(FoundingFollowTest, HoldsTheFeatureSetOfTheLastFrameOnly) {
  ASSERT_NO_FATAL_FAILURE(TrackUntilProposed());
  TrackNext();
  const std::int32_t num_free = device_.num_free_feature_sets();
  for (int i = 0; i < 5; ++i) TrackNext();
  EXPECT_EQ(device_.num_free_feature_sets(), num_free);
}

}  // namespace
}  // namespace haustra::test
