// What every device refuses, with the same words. Each returns ok or the reason.
#pragma once

#include "hal/vision_device.h"

namespace haustra::kernels {

// Number of features of a set; -1 for a stale or invalid handle.
class FeatureCounts {
 public:
  virtual ~FeatureCounts() = default;
  virtual std::int32_t NumFeatures(FeatureSetHandle set) const = 0;
};

Status CheckPlan(const VisionPlan& plan);
Status CheckExtractOptions(const ExtractOptions& options, const VisionPlan& plan);
Status CheckLane(Lane lane);
// `what` names the picture in the message.
Status CheckImageSize(const ImageView& image, const VisionPlan& plan, const char* what);
bool Extracts(Lane lane, const VisionPlan& plan);
int NumExtractingLanes(const VisionPlan& plan);
// Lane and all but the set. static_mask_*: 0 without a static mask.
Status CheckExtractRequest(Lane lane, const ExtractRequest& request, const VisionPlan& plan, int static_mask_width,
                           int static_mask_height);
// That all to be followed lie in the picture. After one of another size none are followed: they lie in any of the plan
// then. last_*: of the picture before on the lane; 0: there was none.
Status CheckPlacesToFollow(const ExtractRequest& request, const VisionPlan& plan, int last_width_px,
                           int last_height_px);
Status CheckMatchRequest(const MatchRequest& request, const VisionPlan& plan, const FeatureCounts& counts);
Status CheckGuidedMatchRequest(const GuidedMatchRequest& request, const VisionPlan& plan, const FeatureCounts& counts);
// All but the set.
Status CheckFeaturesToWrite(std::span<const Keypoint> keypoints, std::span<const std::uint8_t> descriptors,
                            const VisionPlan& plan);

// How many features of the last picture one request may have followed.
inline int MaxFollowed(const VisionPlan& plan) { return 2 * plan.max_features; }
// Hands over where they are, as the caller wants them or not. Nothing followed: none is found.
void DeliverFollowed(std::span<const FollowedPoint> followed, std::span<FollowedPoint> wanted);

// Number of entries of a checked list.
std::int32_t ListSize(const DescriptorList& list, const FeatureCounts& counts);

}  // namespace haustra::kernels
