#include "engine/tracking/overlay_watch.h"

#include <algorithm>

#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// Between two frames that are compared: a trembling hand moves the scene by many sigmas meanwhile, and what has not
// moved then is known within half a second or so.
constexpr double kCompareSeconds = 0.2;
// A pair further apart has too few points in common.
constexpr double kOldSeconds = 1.5;

// Those before the followed ones. A followed feature is no twin of another: they lie densely, many of one scale, so
// some always have another at their place by chance where the scene moves.
int NumDetected(const FrameFeatures& features) { return features.num - features.num_followed; }

}  // namespace

OverlayWatch::OverlayWatch(const InitialisationConfig& noise, bool is_on, int width_px, int height_px, int max_features)
    : noise_(noise),
      is_on_(is_on),
      overlay_(width_px, height_px, max_features),
      before_(static_cast<std::size_t>(max_features)),
      twins_(static_cast<std::size_t>(max_features)),
      stands_still_(static_cast<std::size_t>(max_features)) {
  ReserveTouched(&motions_, static_cast<std::size_t>(max_features));
}

std::size_t OverlayWatch::BytesFor(int max_features) {
  return StaticOverlay::BytesFor(max_features) +
         static_cast<std::size_t>(max_features) *
             (sizeof(Keypoint) + sizeof(std::int32_t) + sizeof(StaticOverlay::Motion) + 1);
}

float OverlayWatch::Sigma(const Keypoint& keypoint) const {
  return static_cast<float>(noise_.noise_k * keypoint.scale_px + noise_.noise_sigma_0_px);
}

void OverlayWatch::Blank(FrameFeatures* features) const {
  if (overlay_.num_static() == 0) return;
  for (int i = 0; i < features->num; ++i) {
    const Keypoint& keypoint = features->keypoints[i];
    if (overlay_.IsStatic(keypoint.x_px, keypoint.y_px)) features->bearings[i] = {};
  }
}

void OverlayWatch::Allow(const FrameFeatures& features, std::span<std::uint8_t> allowed) const {
  for (int i = 0; i < features.num; ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    allowed[static_cast<std::size_t>(i)] = overlay_.IsStatic(keypoint.x_px, keypoint.y_px) ? 0 : 1;
  }
}

double OverlayWatch::SecondsSinceLast(TimePoint before, TimePoint time) {
  const double seconds = ToSeconds(time - (has_last_time_ ? std::max(last_time_, before) : before));
  has_last_time_ = true;
  last_time_ = time;
  return seconds;
}

int OverlayWatch::Sift(const FrameFeatures& before, const FrameFeatures& now, std::span<Match> matches,
                       TimePoint before_time, TimePoint time) {
  if (!is_on_) return static_cast<int>(matches.size());
  motions_.clear();
  for (const Match& match : matches) {
    const Keypoint& a = before.keypoints[match.query];
    const Keypoint& b = now.keypoints[match.train];
    motions_.push_back({{a.x_px, a.y_px}, {b.x_px, b.y_px}, std::max(Sigma(a), Sigma(b))});
  }
  const auto stands_still = std::span(stands_still_).first(motions_.size());
  overlay_.Observe(motions_, SecondsSinceLast(before_time, time), stands_still);
  int kept = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (stands_still[i] == 0) matches[static_cast<std::size_t>(kept++)] = matches[i];
  }
  return kept;
}

bool OverlayWatch::is_due(TimePoint time) const {
  return is_on_ && (num_before_ == 0 || ToSeconds(Apart(time, before_time_)) >= kCompareSeconds);
}

void OverlayWatch::KeepFrame(const FrameFeatures& features, TimePoint time) {
  num_before_ = NumDetected(features);
  std::copy_n(features.keypoints.begin(), num_before_, before_.begin());
  before_time_ = time;
}

void OverlayWatch::Compare(const FrameFeatures& now, std::span<const Tracked> tracked, TimePoint time) {
  if (ToSeconds(Apart(time, before_time_)) > kOldSeconds) return;
  const auto num = static_cast<std::size_t>(now.num);
  const auto twins = std::span(twins_).first(num);
  std::fill(twins.begin(), twins.end(), -1);
  const auto num_detected = static_cast<std::size_t>(NumDetected(now));
  overlay_.FindTwins(std::span(before_).first(static_cast<std::size_t>(num_before_)),
                     std::span(now.keypoints).first(num_detected), noise_.noise_k, noise_.noise_sigma_0_px,
                     twins.first(num_detected));
  motions_.clear();
  for (const Tracked& match : tracked) {
    const Keypoint& keypoint = now.keypoints[match.feature_idx];
    motions_.push_back({match.before_px, {keypoint.x_px, keypoint.y_px}, Sigma(keypoint)});
    twins[static_cast<std::size_t>(match.feature_idx)] = -1;
  }
  for (std::size_t i = 0; i < num; ++i) {
    if (twins[i] < 0) continue;
    const Keypoint& from = before_[static_cast<std::size_t>(twins[i])];
    const Keypoint& to = now.keypoints[i];
    motions_.push_back({{from.x_px, from.y_px}, {to.x_px, to.y_px}, Sigma(to)});
  }
  overlay_.Observe(motions_, SecondsSinceLast(before_time_, time), std::span(stands_still_).first(motions_.size()));
}

}  // namespace haustra
