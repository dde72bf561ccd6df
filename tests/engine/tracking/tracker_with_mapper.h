// A tracker and a mapper on a scripted colon, each stepped by the test. What the tracker has the device follow is
// remembered, and the device can be made to fail.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <utility>
#include <vector>

#include "engine/mapping/mapper.h"
#include "engine/tracking/tracker.h"
#include "hal/forwarding_vision_device.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {

class FollowWatch final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;
  Result<FeatureSetHandle> CreateFeatureSet() override {
    if (std::exchange(has_room, true)) return ForwardingVisionDevice::CreateFeatureSet();
    return Status(StatusCode::kCapacityExceeded);
  }
  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (!std::exchange(sees, true)) return Status(StatusCode::kDataLoss);
    followed.assign(request.follow.begin() + request.num_only_followed, request.follow.end());
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    if (lane == Lane::kTracking && on_search) on_search();
    if (!std::exchange(finds, true)) return Status(StatusCode::kDataLoss);
    return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request);
  }

  std::vector<Keypoint> followed;   // what the last extraction was asked to make features of
  std::function<void()> on_search;  // before every search of the tracker's
  // False: the next frame, or the next search of either side, finds it otherwise.
  bool has_room = true, sees = true, finds = true;
};

class TrackerWithMapper : public testing::Test {
 protected:
  explicit TrackerWithMapper(const EngineConfig& config = SmallEngineConfig(), const Clock* clock = nullptr)
      : colon_(TimePoint{}, config),
        scene_(colon_.camera(), {}),
        link_(config_),
        places_(config_, std::pmr::get_default_resource()),
        device_(colon_.device()),
        mapper_(config_, colon_.camera(), scene_, device_, link_, places_, nullptr, false, nullptr),
        tracker_(config_, colon_.camera(), scene_, device_, link_, clock) {
    colon_.config().merging.enabled = false;
    colon_.Move(0.0, 3.0, 100);
  }

  FrameResult TrackNext(TimePoint deadline = kNoDeadline) {
    const Result<Frame> frame = colon_.source().Next(kNoDeadline);
    EXPECT_TRUE(frame.ok());
    return tracker_.Track(*frame, deadline);
  }
  void Map() {
    while (mapper_.Step()) continue;
  }
  FrameResult TrackAndMap(int num_frames) {
    FrameResult result;
    for (int i = 0; i < num_frames; ++i) {
      result = TrackNext();
      Map();
    }
    return result;
  }

  ScriptedColon colon_;
  const EngineConfig& config_ = colon_.config();
  SceneRegion scene_;
  TrackingLink link_;
  PlaceMailbox places_;
  FollowWatch device_;
  Mapper mapper_;
  Tracker tracker_;
};

}  // namespace haustra::test
