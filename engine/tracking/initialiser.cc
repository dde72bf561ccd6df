#include "engine/tracking/initialiser.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/rng_streams.h"
#include "engine/geometry/rotation_fit.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// A triangulated point whose rays are nearer to parallel than this says nothing about depth.
constexpr double kMinPointParallax = 0.15 * kDegree;

}  // namespace

Initialiser::Initialiser(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, LaneWait& lane,
                         OverlayWatch& overlay, const SceneRegion& scene, std::pmr::memory_resource* memory)
    : config_(config),
      camera_(camera),
      device_(device),
      lane_(lane),
      overlay_(overlay),
      window_{static_cast<float>(config.initialisation.max_disparity_deg * kDegree * camera.focal_px()),
              static_cast<float>(config.initialisation.max_disparity_deg * kDegree * camera.focal_px())},
      scene_(scene),
      ransac_(config.features.max),
      rng_(config.seed, rng_stream::kFounding),
      reference_(config.features.max, memory),
      pairs_(static_cast<std::size_t>(config.features.max), memory),
      between_(MakeViews(config.initialisation.kept_views, config.features.max, memory)),
      matches_(static_cast<std::size_t>(config.features.max)) {
  ReserveTouched(&bearings_a_, matches_.size());
  ReserveTouched(&bearings_b_, matches_.size());
  ReserveTouched(&tolerance_, matches_.size());
  ReserveTouched(&parallax_, matches_.size());
  ReserveTouched(&residual_, matches_.size());
  ReserveTouched(&pixels_, matches_.size());
}

std::size_t Initialiser::BytesFor(int max_features, int max_between) {
  return FrameFeatures::BytesFor(max_features) + MemoryArena::BytesFor<FoundingPair>(max_features) +
         BytesForViews(max_between, max_features);
}

void Initialiser::Reset() {
  if (has_reference_) device_.ReleaseFeatureSet(reference_.features.set);
  has_reference_ = false;
  for (std::size_t i = 0; i < num_between_; ++i) device_.ReleaseFeatureSet(between_[i].features.set);
  num_between_ = 0;
  num_skipped_ = 0;
}

void Initialiser::Keep(const ProposedView& view) {
  if (!has_reference_) {
    CopyView(view, &reference_);
    has_reference_ = true;
    is_unexplained_ = false;
    return;
  }
  if (num_between_ == between_.size()) ThinOut();
  CopyView(view, &between_[num_between_++]);
}

void Initialiser::ThinOut() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < num_between_; ++i) {
    if (i % 2 == 0) {
      device_.ReleaseFeatureSet(between_[i].features.set);
    } else {
      std::swap(between_[kept++], between_[i]);
    }
  }
  num_between_ = kept;
  num_skipped_ /= 2;
}

void Initialiser::RenewReference() {
  if (num_between_ > 0) {
    BeginWith(num_between_ / 2);
  } else {
    device_.ReleaseFeatureSet(reference_.features.set);
    has_reference_ = false;
  }
}

void Initialiser::BeginWith(std::size_t kept) {
  device_.ReleaseFeatureSet(reference_.features.set);
  for (std::size_t i = 0; i < kept; ++i) device_.ReleaseFeatureSet(between_[i].features.set);
  std::swap(reference_, between_[kept]);
  std::rotate(between_.begin(), between_.begin() + static_cast<std::ptrdiff_t>(kept) + 1,
              between_.begin() + static_cast<std::ptrdiff_t>(num_between_));
  num_between_ -= kept + 1;
  num_skipped_ = 0;
  is_unexplained_ = false;
}

const ProposedView& Initialiser::EarlierView(std::size_t num_skipped) const {
  return num_skipped == 0 ? reference_ : between_[num_skipped - 1];
}

void Initialiser::MoveInto(KeyframeProposal* proposal) {
  proposal->cam_from_reference = cam_from_reference_;
  std::swap(proposal->reference, reference_);
  std::swap(proposal->pairs, pairs_);
  proposal->num_pairs = num_pairs_;
  std::swap(proposal->between, between_);
  proposal->num_between = static_cast<std::int32_t>(num_between_);
  has_reference_ = false;
  num_between_ = 0;
  num_skipped_ = 0;
}

TrackingReason Initialiser::Try(const ProposedView& view, const FrameBudget& budget) {
  const ProposedView& earlier = EarlierView(num_skipped_);
  const TrackingReason reason = Compare(earlier, view, budget);
  if (reason == TrackingReason::kNoTime) return reason;
  if (reason == TrackingReason::kMapProposed) {
    if (num_skipped_ > 0) BeginWith(num_skipped_ - 1);
    return reason;
  }
  is_worn_out_ = num_skipped_ == 0 && HasWornOut(reason, view.timestamp);
  ChooseNext(reason, view.timestamp);
  return reason;
}

bool Initialiser::HasWornOut(TrackingReason reason, TimePoint time) {
  const bool was_unexplained = is_unexplained_;
  is_unexplained_ = reason == TrackingReason::kNoEpipolarGeometry;
  if (is_unexplained_ && !was_unexplained) unexplained_since_ = time;
  return reason == TrackingReason::kFewMatches || (is_unexplained_ && ToMilliseconds(Apart(time, unexplained_since_)) >
                                                                          config_.initialisation.max_unexplained_ms);
}

void Initialiser::ChooseNext(TrackingReason reason, TimePoint time) {
  const std::size_t num_left = num_between_ - num_skipped_;
  num_skipped_ += (num_left + 1) / 2;
  // Of views that are nearer still there is even less parallax.
  const bool is_near =
      reason == TrackingReason::kLowParallax || num_left == 0 ||
      ToMilliseconds(Apart(time, EarlierView(num_skipped_).timestamp)) < config_.initialisation.min_gap_ms;
  if (is_near) num_skipped_ = 0;
}

TrackingReason Initialiser::Compare(const ProposedView& earlier, const ProposedView& view, const FrameBudget& budget) {
  const InitialisationConfig& options = config_.initialisation;
  num_matches_ = num_inliers_ = num_pairs_ = 0;

  MatchRequest request;
  request.query = DescriptorList::Whole(earlier.features.set);
  request.train = DescriptorList::Whole(view.features.set);
  request.options = {static_cast<float>(config_.matching.min_similarity), static_cast<float>(options.brute_force_ratio),
                     true};
  request.disparity = &window_;
  request.matches = matches_;
  request.num_matches = &num_matches_;
  if (!lane_.Match(request, budget.initialise_deadline()).ok()) {
    return lane_.has_pending() ? TrackingReason::kNoTime : TrackingReason::kFewMatches;
  }
  num_matches_ =
      overlay_.Sift(earlier.features, view.features, std::span(matches_).first(static_cast<std::size_t>(num_matches_)),
                    earlier.timestamp, view.timestamp);
  num_matches_ = DropWithoutBearing(earlier.features, view.features,
                                    std::span(matches_).first(static_cast<std::size_t>(num_matches_)));
  if (num_matches_ < options.min_matches) return TrackingReason::kFewMatches;
  if (ToMilliseconds(Apart(view.timestamp, earlier.timestamp)) < options.min_gap_ms) {
    return TrackingReason::kLowParallax;
  }

  bearings_a_.clear();
  bearings_b_.clear();
  tolerance_.clear();
  for (int i = 0; i < num_matches_; ++i) {
    const Keypoint& a = earlier.features.keypoints[matches_[i].query];
    const Keypoint& b = view.features.keypoints[matches_[i].train];
    bearings_a_.push_back(earlier.features.bearing(matches_[i].query));
    bearings_b_.push_back(view.features.bearing(matches_[i].train));
    const double sigma = options.noise_k * std::max(a.scale_px, b.scale_px) + options.noise_sigma_0_px;
    tolerance_.push_back(kGateOneDof * sigma / camera_.focal_px());
  }
  TwoViewRansac::Estimate estimate;
  TwoViewRansac::Options ransac;
  ransac.should_stop = [&budget] { return budget.ShouldStopInitialising(); };
  const bool found = ransac_.Run(bearings_a_, bearings_b_, tolerance_, ransac, rng_, &estimate);
  if (!found && budget.ShouldStopInitialising()) return TrackingReason::kNoTime;
  if (ransac_.has_rival()) return TrackingReason::kUncertainMotion;
  num_inliers_ = found ? estimate.num_inliers : ransac_.num_still();
  if (num_inliers_ < options.min_points || num_inliers_ < options.min_inlier_share * num_matches_) {
    return TrackingReason::kNoEpipolarGeometry;
  }
  if (!found) return TrackingReason::kLowParallax;

  // What no rotation explains, in the middle of the inliers.
  Eigen::Matrix3d rotation;
  residual_.resize(static_cast<std::size_t>(num_matches_));
  if (!FitRotation(bearings_a_, bearings_b_, ransac_.inliers(), &rotation, residual_)) {
    return TrackingReason::kNoEpipolarGeometry;
  }
  parallax_.clear();
  pixels_.clear();
  for (int i = 0; i < num_matches_; ++i) {
    if (ransac_.inliers()[i] == 0) continue;
    const double sigma = tolerance_[i] / kGateOneDof;
    const double enough = std::min(options.min_parallax_sigmas * sigma, options.min_parallax_deg * kDegree);
    parallax_.push_back(residual_[i] / enough);
    if (ransac_.parallax_rad()[i] < kMinPointParallax) continue;
    pairs_[num_pairs_++] = {matches_[i].query, matches_[i].train, ransac_.points_in_a()[i]};
    pixels_.push_back(view.features.pixel(matches_[i].train));
  }
  std::nth_element(parallax_.begin(), parallax_.begin() + parallax_.size() / 2, parallax_.end());
  if (parallax_[parallax_.size() / 2] < 1.0) return TrackingReason::kLowParallax;
  if (num_pairs_ < options.min_points) return TrackingReason::kLowParallax;
  // Once for the noise itself; once more because what a wall's own motion does to a direction does not average out.
  const double direction_sigma = estimate.direction_sigma_rad * estimate.noise_ratio * estimate.noise_ratio;
  if (direction_sigma > options.max_direction_sigma_deg * kDegree) return TrackingReason::kUncertainMotion;
  if (scene_.Spread(pixels_) < options.min_spread) return TrackingReason::kLowSpread;
  cam_from_reference_ = estimate.b_from_a;
  return TrackingReason::kMapProposed;
}

}  // namespace haustra
