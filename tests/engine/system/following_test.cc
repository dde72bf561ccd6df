// Which features of the last picture the tracker asks the device to follow, and what they count for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

#include "hal/forwarding_vision_device.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

// Remembers what the last request named, and what the picture before it had.
class RecordingDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    before = std::move(found_);
    found_.clear();
    follow.assign(request.follow.begin() + request.num_only_followed, request.follow.end());
    num_only_followed = request.num_only_followed;
    keypoints_ = request.keypoints;
    num_keypoints_ = request.num_keypoints;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = ForwardingVisionDevice::Wait(ticket, deadline);
    if (num_keypoints_ != nullptr) found_.assign(keypoints_.begin(), keypoints_.begin() + *num_keypoints_);
    num_keypoints_ = nullptr;
    return status;
  }

  std::vector<Keypoint> before;
  std::vector<Keypoint> follow;  // to become features
  int num_only_followed = 0;

 private:
  std::vector<Keypoint> found_;
  std::span<Keypoint> keypoints_;
  std::int32_t* num_keypoints_ = nullptr;
};

// Of the features of a frame only so many were detected; it says that the others were followed.
class DetectingFewDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (lane == Lane::kTracking) request_ = request;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = ForwardingVisionDevice::Wait(ticket, deadline);
    if (request_.num_followed != nullptr) *request_.num_followed = std::max(*request_.num_keypoints - num_detected, 0);
    request_ = {};
    return status;
  }

  std::int32_t num_detected = std::numeric_limits<std::int32_t>::max();

 private:
  ExtractRequest request_;
};

// Says that all points it is asked for have gone to the right, however the scope moves.
class DriftingDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (lane == Lane::kTracking) request_ = request;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = ForwardingVisionDevice::Wait(ticket, deadline);
    const auto right = static_cast<float>(request_.image.width - 1);
    for (std::size_t i = 0; i < request_.followed_to.size() && drift_px > 0.0f; ++i) {
      const Keypoint& from = request_.follow[i];
      request_.followed_to[i] = {std::min(from.x_px + drift_px, right), from.y_px, true, true};
    }
    request_ = {};
    return status;
  }

  float drift_px = 0.0f;

 private:
  ExtractRequest request_;
};

using Places = std::vector<std::tuple<float, float, float>>;
Places SortedPlaces(const std::vector<Keypoint>& keypoints) {
  Places places;
  for (const Keypoint& k : keypoints) places.emplace_back(k.x_px, k.y_px, k.scale_px);
  std::sort(places.begin(), places.end());
  return places;
}

// Before a map is proposed nothing is followed, and from its second view on everything is (founding_follow_test.cc).
TEST(Following, AllFeaturesOfATrackedFrameAreNamedAndNoneWithoutAMap) {
  ScriptedColon colon;
  colon.Move(0.0, 3.0, 60);
  colon.Occlude(5);
  colon.Move(15.0, 17.0, 40);
  RecordingDevice device(colon.device());
  const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device);
  FrameResult last;
  int num_tracked = 0, num_without_map = 0;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    const FrameResult result = engine->Track(*frame, kNoDeadline);
    const bool is_tracked = last.state == TrackingState::kTracking;
    if (is_tracked || last.reason == TrackingReason::kMapProposed) {
      EXPECT_EQ(SortedPlaces(device.follow), SortedPlaces(device.before)) << result.frame_index;
      num_tracked += is_tracked ? 1 : 0;
    } else {
      EXPECT_TRUE(device.follow.empty()) << result.frame_index;
      num_without_map += device.before.empty() ? 0 : 1;
    }
    last = result;
    while (engine->BackgroundStep()) {
    }
  }
  EXPECT_GT(num_tracked, 50);
  EXPECT_GT(num_without_map, 5);
}

// What is followed slides together with whatever comes before the wall, and agrees with itself.
TEST(Following, APoseThatHangsOnFollowedFeaturesIsNotBelieved) {
  for (const bool is_enough : {true, false}) {
    ScriptedColon colon;
    colon.Move(0.0, 3.0, 60);
    DetectingFewDevice device(colon.device());
    const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device);
    const TrackingConfig& tracking = colon.config().tracking;
    FrameResult last;
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      if (frame->index == 59) device.num_detected = is_enough ? tracking.min_inliers - 1 : tracking.min_detected - 1;
      last = engine->Track(*frame, kNoDeadline);
      while (engine->BackgroundStep()) {
      }
      ASSERT_TRUE(frame->index != 58 || last.state == TrackingState::kTracking);
    }
    EXPECT_EQ(last.state, is_enough ? TrackingState::kTracking : TrackingState::kLost);
    EXPECT_EQ(last.reason, is_enough ? TrackingReason::kTracked : TrackingReason::kWeakEvidence);
  }
}

// A pose that was chosen among all is not sure, and what is followed from it cannot make it so. One frame later it is.
TEST(Following, APoseThatWasChosenIsConfirmedByDetectedFeaturesOnly) {
  for (const std::uint32_t num_between : {0u, 1u}) {
    ScriptedColon colon;
    colon.Move(0.0, 3.0, 60);
    colon.Occlude(3);
    colon.Move(3.0, 3.0, 20);
    DetectingFewDevice device(colon.device());
    const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device);
    std::uint32_t found = 0;
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      const bool is_judged = found != 0 && frame->index == found + 1 + num_between;
      if (is_judged) device.num_detected = colon.config().tracking.min_inliers - 1;
      const FrameResult result = engine->Track(*frame, kNoDeadline);
      while (engine->BackgroundStep()) {
      }
      if (is_judged) {
        EXPECT_EQ(result.reason, num_between == 0 ? TrackingReason::kWeakEvidence : TrackingReason::kTracked);
        break;
      }
      if (frame->index >= 63 && found == 0 && result.state == TrackingState::kTracking) {
        EXPECT_NE(result.reason, TrackingReason::kTracked);
        found = result.frame_index;
      }
    }
    EXPECT_NE(found, 0u);
  }
}

// Brute force finds the old place at once. Flow that says otherwise is believed for a second, and no longer.
TEST(Following, APoseThatFlowDeniesIsNotAnswered) {
  std::uint32_t first_pose[2] = {0, 0};
  for (const bool has_drift : {false, true}) {
    ScriptedColon colon;
    colon.Move(0.0, 3.0, 60);
    colon.Occlude(3);
    colon.Move(3.0, 3.0, 60);
    DriftingDevice device(colon.device());
    const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device);
    MapId map_id = kNoId;
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      if (frame->index == 60) device.drift_px = has_drift ? 20.0f : 0.0f;
      const FrameResult result = engine->Track(*frame, kNoDeadline);
      if (frame->index == 59) map_id = result.map_id;
      const bool is_found = frame->index >= 63 && result.state == TrackingState::kTracking && result.map_id == map_id;
      if (is_found && first_pose[has_drift] == 0) first_pose[has_drift] = frame->index;
      while (engine->BackgroundStep()) {
      }
    }
  }
  EXPECT_GE(first_pose[0], 63u);
  EXPECT_LE(first_pose[0], 65u);
  EXPECT_GE(first_pose[1], 80u);
  EXPECT_LE(first_pose[1], 95u);
}

TEST(Following, NoneAreNamedWhenTheConfigurationSaysSo) {
  EngineConfig config = SmallEngineConfig();
  config.features.are_followed = false;
  ScriptedColon colon(TimePoint{}, config);
  colon.Move(0.0, 2.0, 40);
  RecordingDevice device(colon.device());
  const auto engine = colon.MakeEngine(Engine::Mode::kSequential, device);
  int num_tracked = 0;
  for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
    num_tracked += engine->Track(*frame, kNoDeadline).state == TrackingState::kTracking ? 1 : 0;
    EXPECT_TRUE(device.follow.empty());
    EXPECT_EQ(device.num_only_followed, 0);
    while (engine->BackgroundStep()) {
    }
  }
  EXPECT_GT(num_tracked, 20);
}

}  // namespace
}  // namespace haustra::test
