#include "engine/mapping/view_pair.h"

#include <algorithm>

#include "engine/geometry/constants.h"

namespace haustra {

ViewPair::ViewPair(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera, VisionDevice& device)
    : config_(config),
      noise_(noise),
      camera_(camera),
      device_(device),
      matches_(static_cast<std::size_t>(config.features.max)) {}

bool ViewPair::Compare(const Keyframe& a, const Keyframe& b) {
  bearings_a_.clear();
  bearings_b_.clear();
  tolerance_rad_.clear();
  std::int32_t num = 0;
  MatchRequest request;
  request.query = DescriptorList::Whole(a.features.set);
  request.train = DescriptorList::Whole(b.features.set);
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.mapping.link_ratio), true};
  request.matches = matches_;
  request.num_matches = &num;
  if (!MatchAndWait(device_, Lane::kBackground, request).ok()) return false;
  num = DropWithoutBearing(a.features, b.features, std::span(matches_).first(static_cast<std::size_t>(num)));
  for (std::int32_t i = 0; i < num; ++i) {
    const Match& match = matches_[i];
    bearings_a_.push_back(a.features.bearing(match.query));
    bearings_b_.push_back(b.features.bearing(match.train));
    const double scale =
        std::max(a.features.keypoints[match.query].scale_px, b.features.keypoints[match.train].scale_px);
    tolerance_rad_.push_back(kGateOneDof * noise_.SigmaPx(scale) / camera_.focal_px());
  }
  return true;
}

}  // namespace haustra
