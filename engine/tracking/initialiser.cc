#include "engine/tracking/initialiser.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/ellipse_spread.h"
#include "engine/geometry/rotation_fit.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

constexpr double kGateOneDof = 1.96;  // 95 %
// A triangulated point whose rays are nearer to parallel than this says nothing about depth.
constexpr double kMinPointParallax = 0.15 * kDegree;

}  // namespace

Initialiser::Initialiser(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, LaneWait& lane,
                         double scene_share, std::pmr::memory_resource* memory)
    : config_(config),
      camera_(camera),
      device_(device),
      lane_(lane),
      window_{static_cast<float>(config.initialisation.max_disparity_x_px),
              static_cast<float>(config.initialisation.max_disparity_y_px)},
      scene_share_(scene_share),
      ransac_(config.features.max),
      rng_(config.seed, 1),
      reference_(config.features.max, memory),
      pairs_(static_cast<std::size_t>(config.features.max), memory),
      between_(MakeViews(config.initialisation.max_reference_age_frames, config.features.max, memory)),
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
}

void Initialiser::SetReference(const ProposedView& view) {
  Reset();
  CopyView(view, &reference_);
  has_reference_ = true;
  num_unexplained_ = 0;
}

bool Initialiser::KeepBetween(const ProposedView& view) {
  if (num_between_ == between_.size()) return false;
  CopyView(view, &between_[num_between_++]);
  return true;
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
}

TrackingReason Initialiser::Try(const ProposedView& view, TimePoint deadline) {
  const TrackingReason reason = Compare(view, deadline);
  num_unexplained_ = reason == TrackingReason::kNoEpipolarGeometry ? num_unexplained_ + 1 : 0;
  is_worn_out_ =
      reason == TrackingReason::kFewMatches || num_unexplained_ > config_.initialisation.max_unexplained_frames;
  return reason;
}

TrackingReason Initialiser::Compare(const ProposedView& view, TimePoint deadline) {
  const InitialisationConfig& options = config_.initialisation;
  num_matches_ = num_inliers_ = num_pairs_ = 0;

  MatchRequest request;
  request.query = DescriptorList::Whole(reference_.features.set);
  request.train = DescriptorList::Whole(view.features.set);
  request.options = {static_cast<float>(config_.matching.min_similarity), static_cast<float>(options.brute_force_ratio),
                     true};
  request.disparity = &window_;
  request.matches = matches_;
  request.num_matches = &num_matches_;
  if (!lane_.Match(request, deadline).ok()) return TrackingReason::kFewMatches;
  if (num_matches_ < options.min_matches) return TrackingReason::kFewMatches;
  if (view.frame_index - reference_.frame_index > static_cast<std::uint32_t>(options.max_reference_age_frames)) {
    return TrackingReason::kFewMatches;
  }

  if (view.frame_index - reference_.frame_index < static_cast<std::uint32_t>(options.min_gap_frames)) {
    return TrackingReason::kLowParallax;
  }

  bearings_a_.clear();
  bearings_b_.clear();
  tolerance_.clear();
  for (int i = 0; i < num_matches_; ++i) {
    const Keypoint& a = reference_.features.keypoints[matches_[i].query];
    const Keypoint& b = view.features.keypoints[matches_[i].train];
    bearings_a_.push_back(reference_.features.bearing(matches_[i].query));
    bearings_b_.push_back(view.features.bearing(matches_[i].train));
    const double sigma = options.noise_k * std::max(a.scale_px, b.scale_px) + options.noise_sigma_0_px;
    tolerance_.push_back(kGateOneDof * sigma / camera_.focal_px());
  }
  TwoViewRansac::Estimate estimate;
  const bool found = ransac_.Run(bearings_a_, bearings_b_, tolerance_, TwoViewRansac::Options{}, rng_, &estimate);
  num_inliers_ = found ? estimate.num_inliers : 0;
  if (!found || num_inliers_ < options.min_points || num_inliers_ < options.min_inlier_share * num_matches_) {
    return TrackingReason::kNoEpipolarGeometry;
  }

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
    parallax_.push_back(residual_[i]);
    if (ransac_.parallax_rad()[i] < kMinPointParallax) continue;
    pairs_[num_pairs_++] = {matches_[i].query, matches_[i].train, ransac_.points_in_a()[i]};
    pixels_.push_back(view.features.pixel(matches_[i].train));
  }
  std::nth_element(parallax_.begin(), parallax_.begin() + parallax_.size() / 2, parallax_.end());
  if (parallax_[parallax_.size() / 2] < options.min_parallax_deg * kDegree) return TrackingReason::kLowParallax;
  if (num_pairs_ < options.min_points) return TrackingReason::kLowParallax;
  if (EllipseSpread(pixels_, camera_.width_px(), camera_.height_px()) < options.min_spread * scene_share_) {
    return TrackingReason::kLowSpread;
  }
  cam_from_reference_ = estimate.b_from_a;
  return TrackingReason::kMapProposed;
}

}  // namespace haustra
