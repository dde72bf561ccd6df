// A vision device that hands everything on to another one: the base of those that change a few of the calls (wait for a
// gap, take time, tell a test). As thread-safe as the other device; units, errors and threads are those of
// hal/vision_device.h.
#pragma once

#include "hal/vision_device.h"

namespace haustra {

class ForwardingVisionDevice : public VisionDevice {
 public:
  // `device` outlives this.
  explicit ForwardingVisionDevice(VisionDevice& device) : device_(device) {}

  std::string_view name() const override { return device_.name(); }
  bool is_accelerator() const override { return device_.is_accelerator(); }
  const VisionPlan& plan() const override { return device_.plan(); }
  Status SetStaticMask(ImageView mask) override { return device_.SetStaticMask(mask); }
  Result<FeatureSetHandle> CreateFeatureSet() override { return device_.CreateFeatureSet(); }
  bool RetainFeatureSet(FeatureSetHandle set) override { return device_.RetainFeatureSet(set); }
  void ReleaseFeatureSet(FeatureSetHandle set) override { device_.ReleaseFeatureSet(set); }
  std::int32_t num_free_feature_sets() const override { return device_.num_free_feature_sets(); }
  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    return device_.EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    return device_.EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    return device_.EnqueueGuidedMatch(lane, request);
  }
  Status Wait(Ticket ticket, TimePoint deadline) override { return device_.Wait(ticket, deadline); }
  bool Abandon(Ticket ticket) override { return device_.Abandon(ticket); }
  Status ServeThisThread(Lane lane) override { return device_.ServeThisThread(lane); }
  Status ReadDescriptors(FeatureSetHandle set, std::span<std::uint8_t> out) override {
    return device_.ReadDescriptors(set, out);
  }
  Status WriteFeatures(FeatureSetHandle set, std::span<const Keypoint> keypoints,
                       std::span<const std::uint8_t> descriptors) override {
    return device_.WriteFeatures(set, keypoints, descriptors);
  }

 private:
  VisionDevice& device_;
};

}  // namespace haustra
