// Which of the matches a pose is fitted to. A wall and what comes before it, as points in space: the truth is the pose
// from which the wall was projected.
#include "engine/tracking/pose_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/forwarding_vision_device.h"
#include "tests/engine/tracking/search_in_map.h"

namespace haustra::test {
namespace {

TimePoint AfterMs(int ms) { return TimePoint(std::chrono::milliseconds(ms)); }

// Never answers a search.
class SilentDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;
  Result<Ticket> EnqueueGuidedMatch(Lane, const GuidedMatchRequest& request) override {
    allowed = request.train_allowed;
    return Ticket{1};
  }
  Status Wait(Ticket, TimePoint) override { return Status(StatusCode::kDeadlineExceeded); }

  std::span<const std::uint8_t> allowed;  // of the last one, which may still read it
};

class PoseSearchTest : public SearchInMap {
 protected:
  // Points of the map that the frame shows as if it stood at `pose`, seen by so many keyframes.
  void Add(int num, const SE3& pose, int num_keyframes, TimePoint established) {
    for (int i = 0; i < num; ++i) {
      const Eigen::Vector3d in_cam(rng_.Uniform(-0.5, 0.5), rng_.Uniform(-0.4, 0.4), rng_.Uniform(1.5, 3.0));
      LocalPoint& point = map_.points[map_.num_points];
      point.position = pose.Inverse() * in_cam;
      point.keyframe_mask = (std::uint64_t{1} << num_keyframes) - 1;
      point.established = established;
      const int feature = frame_.features.num++;
      Show(in_cam, &frame_.features.keypoints[feature]);
      search_.estimate().matches.push_back({feature, map_.num_points++});
    }
  }
  void LookAtPoints() {
    for (int i = 0; i < map_.num_points; ++i) {
      map_.points[i].normal = (wall_.InverseTranslation() - map_.points[i].position).normalized();
    }
  }
  // How far from the truth the fit ends that begins at the last pose.
  double ErrorOfFit() {
    PublishMap();
    search_.estimate().cam_from_map = SE3{};
    EXPECT_TRUE(search_.FitMatches());
    return (search_.estimate().cam_from_map.translation - wall_.translation).norm();
  }
  int NumMatches() const { return static_cast<int>(search_.estimate().matches.size()); }

  const SE3 wall_{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.06, 0.0, 0.0)};
  const SE3 debris_{Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.01, 0.01, 0.0)};
};

TEST_F(PoseSearchTest, YoungPointsThatAreMoreDoNotOutvoteTheWall) {
  Add(30, wall_, 3, AfterMs(0));
  Add(90, debris_, 2, TimePoint::max());
  EXPECT_LT(ErrorOfFit(), 1e-3);
  EXPECT_LT(NumMatches(), 60) << "most of the debris drops out";
}

TEST_F(PoseSearchTest, YoungPointsThatAgreeStay) {
  Add(30, wall_, 3, AfterMs(0));
  Add(90, wall_, 2, TimePoint::max());
  EXPECT_LT(ErrorOfFit(), 1e-3);
  EXPECT_EQ(NumMatches(), 120);
}

TEST_F(PoseSearchTest, OfManyEstablishedPointsSomeLead) {
  Add(400, wall_, 3, AfterMs(0));
  Add(90, debris_, 2, TimePoint::max());
  EXPECT_LT(ErrorOfFit(), 1e-3);
  EXPECT_LT(NumMatches(), 430);
}

TEST_F(PoseSearchTest, TooFewEstablishedPointsLeadNobody) {
  Add(config_.tracking.min_inliers - 1, debris_, 3, AfterMs(0));
  Add(90, wall_, 2, TimePoint::max());
  EXPECT_LT(ErrorOfFit(), 1e-3);
}

TEST_F(PoseSearchTest, WitnessesAreThoseFromBeforeTheViewThinned) {
  sight_.Note(1, 300, 1.0, AfterMs(1000));
  Add(20, wall_, 3, AfterMs(1000));
  Add(20, wall_, 3, AfterMs(1001));
  ErrorOfFit();
  search_.estimate().num_expected = 500;
  search_.CountMatches();
  EXPECT_EQ(search_.estimate().num_established, 40);
  EXPECT_EQ(search_.estimate().num_seasoned, 20);
  EXPECT_TRUE(search_.HasEstablishedWitnesses());
  Add(30, wall_, 3, AfterMs(1001));
  ErrorOfFit();
  search_.CountMatches();
  EXPECT_EQ(search_.estimate().num_established, 70);
  EXPECT_FALSE(search_.HasEstablishedWitnesses()) << "20 of 70";
}

// Bubbles that the map took points from agree with a pose for as long as they stay.
TEST_F(PoseSearchTest, APoseOfDebrisAloneHasNoSeasonedWitnesses) {
  sight_.Note(1, 300, 1.0, AfterMs(1000));
  Add(config_.tracking.min_seasoned, wall_, 3, AfterMs(1000));
  Add(40, wall_, 3, AfterMs(1001));
  ErrorOfFit();
  search_.CountMatches();
  search_.estimate().num_expected_seasoned = 500;
  EXPECT_TRUE(search_.HasSeasonedWitnesses());
  search_.estimate().matches.erase(search_.estimate().matches.begin());
  search_.CountMatches();
  EXPECT_FALSE(search_.HasSeasonedWitnesses());
  EXPECT_FALSE(search_.IsTrackedPoseEvident(true));
}

TEST_F(PoseSearchTest, OnNewWallFewSeasonedPointsShouldBeSeen) {
  sight_.Note(1, 300, 1.0, AfterMs(1000));
  Add(2, wall_, 3, AfterMs(1000));
  Add(40, wall_, 3, AfterMs(1001));
  ErrorOfFit();
  search_.CountMatches();
  search_.estimate().num_expected_seasoned = 20;
  EXPECT_TRUE(search_.HasSeasonedWitnesses());
  search_.estimate().num_expected_seasoned = 21;
  EXPECT_FALSE(search_.HasSeasonedWitnesses());
}

TEST_F(PoseSearchTest, AYoungMapKnewNothingBefore) {
  map_.keyframes.Clear();
  EXPECT_TRUE(map_.keyframes.PushBack({}));
  sight_.Note(1, 300, 1.0, AfterMs(1000));
  Add(40, wall_, 3, AfterMs(1001));
  ErrorOfFit();
  search_.CountMatches();
  search_.estimate().num_expected_seasoned = 500;
  EXPECT_TRUE(search_.HasSeasonedWitnesses());
}

// The search itself counts what should be seen: established points in view, those of before the view thinned by
// themselves.
TEST_F(PoseSearchTest, CountsTheSeasonedPointsInView) {
  sight_.Note(1, 300, 1.0, AfterMs(1000));
  Add(30, wall_, 3, AfterMs(1000));
  Add(20, wall_, 3, AfterMs(1001));
  Add(10, wall_, 2, TimePoint::max());
  LookAtPoints();
  ErrorOfFit();
  search_.SearchLocalMap(0.0);
  EXPECT_EQ(search_.estimate().num_expected, 50);
  EXPECT_EQ(search_.estimate().num_expected_seasoned, 30);
}

TEST_F(PoseSearchTest, ChanceIsNotMeasuredWhereASearchThatRanOutOfTimeStillReads) {
  Add(50, wall_, 3, AfterMs(0));
  LookAtPoints();
  ErrorOfFit();
  SilentDevice device(colon_.device());
  LaneWait lane{device};
  PoseSearch search(
      {config_, colon_.camera(), scene_, lane, budget_, overlay_, noise_, sight_, snapshots_, frame_, last_});
  search.estimate() = search_.estimate();
  budget_.BeginFrame(AfterMs(1), true, false);
  EXPECT_FALSE(search.SearchLocalMap(0.0));
  ASSERT_TRUE(lane.has_pending());
  const std::vector<std::uint8_t> allowed(device.allowed.begin(), device.allowed.end());
  EXPECT_EQ(std::ranges::count(allowed, 0), 50) << "what is matched already is not to be found again";
  EXPECT_FALSE(search.MeasureChance());
  EXPECT_TRUE(std::ranges::equal(allowed, device.allowed));
}

}  // namespace
}  // namespace haustra::test
