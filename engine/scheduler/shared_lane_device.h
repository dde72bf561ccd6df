// The vision device as mapping and merging see it in real-time mode. The background lane takes one thread at a time
// (hal/vision_device.h): from a thread's first request on it until its last one has been waited for, the lane is that
// thread's, and the other one waits. Tracking has the device itself and never meets this lock. thread-safe; a request
// on the background lane is waited for by the thread that made it.
#pragma once

#include "hal/forwarding_vision_device.h"
#include "hal/lane_lock.h"

namespace haustra {

class SharedLaneDevice final : public ForwardingVisionDevice {
 public:
  // `device` outlives this.
  explicit SharedLaneDevice(VisionDevice& device) : ForwardingVisionDevice(device) {}

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    return Begin(lane, [&] { return ForwardingVisionDevice::EnqueueExtract(lane, request); });
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    return Begin(lane, [&] { return ForwardingVisionDevice::EnqueueMatch(lane, request); });
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    return Begin(lane, [&] { return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request); });
  }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = ForwardingVisionDevice::Wait(ticket, deadline);
    const bool is_under_way = status.code() == StatusCode::kDeadlineExceeded && deadline != kNoDeadline;
    if (!is_under_way) lock_.Unlock();
    return status;
  }
  // An accelerator copies on the same lane.
  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override {
    lock_.Lock();
    const Status status = ForwardingVisionDevice::ReadDescriptors(set, out);
    lock_.Unlock();
    return status;
  }
  Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    lock_.Lock();
    const Status status = ForwardingVisionDevice::WriteFeatures(set, keypoints, descriptors);
    lock_.Unlock();
    return status;
  }

 private:
  template <typename Enqueue>
  Result<Ticket> Begin(Lane lane, const Enqueue& enqueue) {
    HAUSTRA_CHECK(lane == Lane::kBackground);
    lock_.Lock();
    const Result<Ticket> ticket = enqueue();
    if (!ticket.ok()) lock_.Unlock();
    return ticket;
  }

  LaneLock lock_;
};

}  // namespace haustra
