#include "engine/tracking/frame_extractor.h"

#include "engine/tracking/reserve_touched.h"

namespace haustra {

FrameExtractor::FrameExtractor(const Parts& parts) : parts_(parts) {
  ReserveTouched(&follow_, static_cast<std::size_t>(parts.config.features.max));
  ReserveTouched(&shows_point_, static_cast<std::size_t>(parts.config.features.max));
}

std::size_t FrameExtractor::BytesFor(int max_features) {
  return static_cast<std::size_t>(max_features) * (sizeof(Keypoint) + 1);
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
  } else {
    request.follow = FeaturesToFollow();
  }
  is_last_extracted_ = false;
  if (!parts_.lane.Extract(request, parts_.budget.wait_deadline()).ok()) {
    if (!parts_.lane.has_pending()) features.num = features.num_followed = 0;
    return false;
  }
  for (int i = 0; i < features.num; ++i) {
    Eigen::Vector3d bearing;
    // A zero bearing agrees with no geometry, so a point outside the model is never used.
    if (!parts_.camera.Unproject(features.pixel(i), &bearing)) bearing.setZero();
    features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                            static_cast<float>(bearing.z())};
  }
  parts_.overlay.Blank(&features);
  return true;
}

// All of the last frame if it was tracked, those that show map points first. None otherwise: what is followed errs
// together, and a founding takes its matches to err each by itself.
std::span<const Keypoint> FrameExtractor::FeaturesToFollow() {
  follow_.clear();
  if (!parts_.config.features.are_followed || !is_last_extracted_) return {};
  const FrameFeatures& features = parts_.last.features;
  shows_point_.assign(static_cast<std::size_t>(features.num), std::uint8_t{0});
  for (const auto& match : parts_.last.matches) {
    shows_point_[match.first] = 1;
    follow_.push_back(features.keypoints[match.first]);
  }
  for (int i = 0; i < features.num; ++i) {
    if (shows_point_[i] == 0) follow_.push_back(features.keypoints[i]);
  }
  return follow_;
}

}  // namespace haustra
