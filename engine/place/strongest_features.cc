#include "engine/place/strongest_features.h"

#include <algorithm>

namespace haustra {
namespace {

void KeepStrongest(const FrameFeatures& features, int max_features, std::vector<std::int32_t>* out) {
  const auto is_stronger = [&](std::int32_t a, std::int32_t b) {
    const float response_a = features.keypoints[a].response, response_b = features.keypoints[b].response;
    return response_a != response_b ? response_a > response_b : a < b;
  };
  const std::size_t kept = std::min(out->size(), static_cast<std::size_t>(max_features));
  std::partial_sort(out->begin(), out->begin() + static_cast<std::ptrdiff_t>(kept), out->end(), is_stronger);
  out->resize(kept);
}

}  // namespace

void SelectStrongest(const FrameFeatures& features, int max_features, std::vector<std::int32_t>* out) {
  out->clear();
  for (std::int32_t i = 0; i < features.num; ++i) out->push_back(i);
  KeepStrongest(features, max_features, out);
}

void SelectStrongestWithPoint(const Keyframe& keyframe, int max_features, std::vector<std::int32_t>* out) {
  out->clear();
  for (std::int32_t i = 0; i < keyframe.features.num; ++i) {
    if (keyframe.points[i]) out->push_back(i);
  }
  KeepStrongest(keyframe.features, max_features, out);
}

}  // namespace haustra
