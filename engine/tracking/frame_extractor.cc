#include "engine/tracking/frame_extractor.h"

#include "engine/tracking/reserve_touched.h"

namespace haustra {

FrameExtractor::FrameExtractor(const Parts& parts) : parts_(parts) {
  const auto max_features = static_cast<std::size_t>(parts.config.features.max);
  ReserveTouched(&follow_, 2 * max_features);
  ReserveTouched(&followed_to_, 2 * max_features);
  ReserveTouched(&shows_point_, max_features);
  ReserveTouched(&order_, max_features);
}

std::size_t FrameExtractor::BytesFor(int max_features) {
  return static_cast<std::size_t>(max_features) *
         (2 * sizeof(Keypoint) + 2 * sizeof(FollowedPoint) + 1 + sizeof(std::int32_t));
}

bool FrameExtractor::Extract(const ImageView& image) {
  const bool has_fewer = parts_.budget.has_fewer_features();
  const FrameBudget::Timer timer(parts_.budget, has_fewer ? Stage::kExtractReduced : Stage::kExtract);
  const Result<FeatureSetHandle> set = parts_.device.CreateFeatureSet();
  if (!set.ok()) {
    if (set.code() == StatusCode::kCapacityExceeded) num_sets_refused_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  FrameFeatures& features = parts_.frame.features;
  features.set = *set;
  features.is_reduced = has_fewer;
  ExtractRequest request;
  request.image = image;
  request.set = *set;
  request.keypoints = features.keypoints;
  request.num_keypoints = &features.num;
  request.num_followed = &features.num_followed;
  if (has_fewer) {
    const SchedulerConfig& scheduler = parts_.config.scheduler;
    request.max_features = static_cast<int>(scheduler.reduced_share * parts_.config.features.num_detected());
    request.min_scale_px = static_cast<float>(scheduler.reduced_min_scale_px);
    parts_.chain.Break();
  } else {
    ListFeaturesToFollow();
    request.follow = follow_;
    request.num_only_followed = parts_.chain.is_fresh() ? 0 : static_cast<int>(parts_.chain.points().size());
    request.followed_to = followed_to_;
  }
  is_last_extracted_ = false;
  if (!parts_.lane.Extract(request, parts_.budget.wait_deadline()).ok()) {
    parts_.chain.Break();
    if (!parts_.lane.has_pending()) features.num = features.num_followed = 0;
    return false;
  }
  if (!has_fewer) parts_.chain.Advance(followed_to_);
  for (int i = 0; i < features.num; ++i) {
    Eigen::Vector3d bearing;
    // Zero: outside of the model. Foundings and searches leave it out.
    if (!parts_.camera.Unproject(features.pixel(i), &bearing)) bearing.setZero();
    features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                            static_cast<float>(bearing.z())};
  }
  parts_.overlay.Blank(&features);
  return true;
}

// The points of the chain, then all features of the last frame if it was tracked. A chain that has just begun has these
// for points. Nothing is followed into a founding: what is followed errs together, and a founding takes its matches
// to err each by itself.
void FrameExtractor::ListFeaturesToFollow() {
  follow_.assign(parts_.chain.points().begin(), parts_.chain.points().end());
  if (parts_.config.features.are_followed && is_last_extracted_ && !parts_.chain.is_fresh()) {
    ListFeatures(parts_.last, &shows_point_, &order_);
    for (const std::int32_t i : order_) follow_.push_back(parts_.last.features.keypoints[i]);
  }
  followed_to_.resize(follow_.size());
}

}  // namespace haustra
