// The vision device as the mapper sees it in real-time mode: each request on the background lane passes the gate first.
// Everything else is the device's. thread-safe as the device is; the background lane has one thread, the mapper's.
#pragma once

#include "engine/scheduler/background_gate.h"
#include "hal/vision_device.h"

namespace haustra {

class GatedVisionDevice final : public VisionDevice {
 public:
  // All outlive this.
  GatedVisionDevice(VisionDevice& device, BackgroundGate& gate, const Clock& clock)
      : device_(device), gate_(gate), clock_(clock) {}

  std::string_view name() const override { return device_.name(); }
  bool is_accelerator() const override { return device_.is_accelerator(); }
  const VisionPlan& plan() const override { return device_.plan(); }
  Status SetStaticMask(ImageView mask) override { return device_.SetStaticMask(mask); }
  Result<FeatureSetHandle> CreateFeatureSet() override { return device_.CreateFeatureSet(); }
  bool RetainFeatureSet(FeatureSetHandle set) override { return device_.RetainFeatureSet(set); }
  void ReleaseFeatureSet(FeatureSetHandle set) override { device_.ReleaseFeatureSet(set); }
  std::int32_t num_free_feature_sets() const override { return device_.num_free_feature_sets(); }

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    Enter(lane);
    return device_.EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    Enter(lane);
    return device_.EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    Enter(lane);
    return device_.EnqueueGuidedMatch(lane, request);
  }
  // Only the mapper waits here, one request at a time: the tracker has the device itself.
  Status Wait(Ticket ticket, TimePoint deadline) override {
    const Status status = device_.Wait(ticket, deadline);
    if (status.ok()) gate_.Leave(clock_.Now() - entered_);
    return status;
  }

  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override {
    return device_.ReadDescriptors(set, out);
  }
  Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    return device_.WriteFeatures(set, keypoints, descriptors);
  }

 private:
  void Enter(Lane lane) {
    if (lane != Lane::kBackground) return;
    gate_.Enter();
    entered_ = clock_.Now();
  }

  VisionDevice& device_;
  BackgroundGate& gate_;
  const Clock& clock_;
  TimePoint entered_;  // of the newest request
};

}  // namespace haustra
