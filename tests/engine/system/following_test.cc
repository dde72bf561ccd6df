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
    follow.assign(request.follow.begin(), request.follow.end());
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
  std::vector<Keypoint> follow;

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

using Places = std::vector<std::tuple<float, float, float>>;
Places SortedPlaces(const std::vector<Keypoint>& keypoints) {
  Places places;
  for (const Keypoint& k : keypoints) places.emplace_back(k.x_px, k.y_px, k.scale_px);
  std::sort(places.begin(), places.end());
  return places;
}

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
    if (last.state == TrackingState::kTracking) {
      EXPECT_EQ(SortedPlaces(device.follow), SortedPlaces(device.before)) << result.frame_index;
      ++num_tracked;
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
    FrameResult last;
    for (Result<Frame> frame = colon.source().Next(kNoDeadline); frame.ok(); frame = colon.source().Next(kNoDeadline)) {
      if (frame->index == 59) device.num_detected = is_enough ? 40 : colon.config().tracking.min_inliers - 1;
      last = engine->Track(*frame, kNoDeadline);
      while (engine->BackgroundStep()) {
      }
      ASSERT_TRUE(frame->index != 58 || last.state == TrackingState::kTracking);
    }
    EXPECT_EQ(last.state, is_enough ? TrackingState::kTracking : TrackingState::kLost);
    EXPECT_EQ(last.reason, is_enough ? TrackingReason::kTracked : TrackingReason::kWeakEvidence);
  }
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
    while (engine->BackgroundStep()) {
    }
  }
  EXPECT_GT(num_tracked, 20);
}

}  // namespace
}  // namespace haustra::test
