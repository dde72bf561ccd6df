// The vision device as mapping and merging see it in real-time mode, below the lock of shared_lane_device.h: each
// request on the background lane passes the gate first, and each copy of a set's descriptors: a checkpoint reads set by
// set, and lets tracking through between two of them. Everything else is the device's. thread-safe as the device is;
// the background lane has one thread at a time.
#pragma once

#include "engine/scheduler/background_gate.h"
#include "hal/forwarding_vision_device.h"

namespace haustra {

class GatedVisionDevice final : public ForwardingVisionDevice {
 public:
  // All outlive this.
  GatedVisionDevice(VisionDevice& device, BackgroundGate& gate, const Clock& clock)
      : ForwardingVisionDevice(device), gate_(gate), clock_(clock) {}

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    Enter(lane);
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    Enter(lane);
    return ForwardingVisionDevice::EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    Enter(lane);
    return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request);
  }
  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override {
    Enter(Lane::kBackground);
    const Status status = ForwardingVisionDevice::ReadDescriptors(set, out);
    gate_.Leave(clock_.Now() - entered_);
    return status;
  }
  // Only mapping and merging wait here, one request at a time: the tracker has the device itself.
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = ForwardingVisionDevice::Wait(ticket, deadline);
    if (status.ok()) gate_.Leave(clock_.Now() - entered_);
    return status;
  }

 private:
  void Enter(Lane lane) {
    if (lane != Lane::kBackground) return;
    gate_.Enter();
    entered_ = clock_.Now();
  }

  BackgroundGate& gate_;
  const Clock& clock_;
  TimePoint entered_;  // of the newest request
};

}  // namespace haustra
