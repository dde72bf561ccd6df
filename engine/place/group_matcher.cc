#include "engine/place/group_matcher.h"

namespace haustra {
namespace {

void ListFeaturesWithPoint(const KeyframeExcerpt& keyframe, std::vector<std::int32_t>* list) {
  list->clear();
  for (std::int32_t i = 0; i < keyframe.num; ++i) {
    if (keyframe.points[i] >= 0) list->push_back(i);
  }
}

}  // namespace

GroupMatcher::GroupMatcher(const EngineConfig& config, const CommonAreaConfig& options, VisionDevice& device)
    : config_(config), options_(options), device_(device), found_(static_cast<std::size_t>(config.features.max)) {}

Status GroupMatcher::Compare(const KeyframeExcerpt& a, const GroupExcerpt& b, std::vector<GroupMatch>* out) {
  out->clear();
  ListFeaturesWithPoint(a, &features_a_);
  for (int view = 0; view < b.num_keyframes; ++view) {
    const KeyframeExcerpt& keyframe_b = b.keyframes[view];
    ListFeaturesWithPoint(keyframe_b, &features_b_);
    if (features_a_.empty() || features_b_.empty()) continue;
    std::int32_t num_matches = 0;
    MatchRequest request;
    request.query = DescriptorList::Subset(a.set, features_a_);
    request.train = DescriptorList::Subset(keyframe_b.set, features_b_);
    request.options = {static_cast<float>(config_.matching.min_similarity),
                       static_cast<float>(options_.max_angle_ratio), true};
    request.matches = found_;
    request.num_matches = &num_matches;
    HAUSTRA_TRY(MatchAndWait(device_, Lane::kBackground, request));
    for (std::int32_t m = 0; m < num_matches; ++m) {
      out->push_back({features_a_[found_[m].query], view, features_b_[found_[m].train], found_[m].similarity});
    }
  }
  return Status::Ok();
}

}  // namespace haustra
