#include "engine/place/relocaliser.h"

#include <algorithm>

#include "engine/geometry/rng_streams.h"
#include "engine/place/rival_poses.h"
#include "engine/place/strongest_features.h"

namespace haustra {
namespace {

constexpr int kMaxPlacesAsked = 20;
// Covisible keyframes of the candidate whose points the frame may see.
constexpr int kWideViewGroup = 10;
constexpr int kGuidedPoseRounds = 2;

}  // namespace

std::string_view ToString(RelocalisationVerdict verdict) {
  switch (verdict) {
    case RelocalisationVerdict::kAccepted: return "accepted";
    case RelocalisationVerdict::kNoCandidate: return "no_candidate";
    case RelocalisationVerdict::kDeviceFailed: return "device_failed";
    case RelocalisationVerdict::kFewMatches: return "few_matches";
    case RelocalisationVerdict::kNoPose: return "no_pose";
    case RelocalisationVerdict::kLowMatchShare: return "low_match_share";
    case RelocalisationVerdict::kFewInliers: return "few_inliers";
    case RelocalisationVerdict::kLowInlierShare: return "low_inlier_share";
    case RelocalisationVerdict::kLowSpread: return "low_spread";
    case RelocalisationVerdict::kUncertain: return "uncertain";
    case RelocalisationVerdict::kAmbiguous: return "ambiguous";
  }
  return "unknown";
}

Relocaliser::Relocaliser(const EngineConfig& config, const RelocalisationConfig& options, const NoiseModel& noise,
                         const RetrievalConfig& retrieval_options, const CameraModel& camera, const SceneRegion& scene,
                         VisionDevice& device, KeyframeRetrieval& retrieval)
    : config_(config),
      noise_(noise),
      options_(options),
      retrieval_options_(retrieval_options),
      scene_(scene),
      device_(device),
      retrieval_(retrieval),
      pose_from_matches_(camera, config.features.max),
      search_(config, noise, camera, device),
      collector_(config.memory.max_map_points),
      rng_(config.seed, rng_stream::kRelocaliser),
      matches_(static_cast<std::size_t>(config.features.max)) {}

bool Relocaliser::Relocalise(const Atlas& atlas, const FrameFeatures& features, Relocalisation* out,
                             std::vector<RelocalisationCounts>* tried) {
  tried->clear();
  SelectStrongest(features, retrieval_options_.max_descriptors, &strongest_);
  RetrievalQuery query;
  query.set = features.set;
  query.strongest = strongest_;
  query.max_results = kMaxPlacesAsked;
  if (!retrieval_.Query(atlas, query, &candidates_).ok()) {
    tried->push_back({.verdict = RelocalisationVerdict::kDeviceFailed});
    return false;
  }
  if (candidates_.empty()) tried->push_back({.verdict = RelocalisationVerdict::kNoCandidate});
  tried_.clear();
  int num_tried = 0;
  for (std::size_t i = 0; i < candidates_.size() && num_tried < options_.max_candidates; ++i) {
    // Its points were matched already with another candidate.
    if (IsTried(candidates_[i].keyframe)) continue;
    ++num_tried;
    const bool is_accepted = TryNext(atlas, features, candidates_[i], out) == RelocalisationVerdict::kAccepted;
    if (is_accepted && HasRival(atlas, features, i, *out)) out->counts.verdict = RelocalisationVerdict::kAmbiguous;
    tried->push_back(out->counts);
    if (is_accepted) return out->counts.verdict == RelocalisationVerdict::kAccepted;
  }
  return false;
}

bool Relocaliser::IsTried(KeyframeHandle keyframe) const {
  return std::find(tried_.begin(), tried_.end(), keyframe) != tried_.end();
}

RelocalisationVerdict Relocaliser::TryNext(const Atlas& atlas, const FrameFeatures& features,
                                           const RetrievalCandidate& candidate, Relocalisation* out) {
  *out = Relocalisation{};
  const Keyframe& keyframe = atlas.keyframe(candidate.keyframe);
  out->map = keyframe.map;
  out->counts.keyframe = keyframe.id;
  out->counts.map_id = atlas.map(out->map).id;
  out->counts.num_votes = candidate.num_votes;
  out->counts.verdict = Try(atlas, features, candidate.keyframe, out);
  return out->counts.verdict;
}

// Poses in two maps cannot be compared: both may be right.
bool Relocaliser::HasRival(const Atlas& atlas, const FrameFeatures& features, std::size_t accepted_idx,
                           const Relocalisation& accepted) {
  const RecognitionConfig& recognition = config_.place.recognition;
  const double min_votes = recognition.rival_share * accepted.counts.num_votes;
  int num_tried = 0;
  for (std::size_t i = accepted_idx + 1; i < candidates_.size() && num_tried < options_.max_candidates; ++i) {
    const RetrievalCandidate& candidate = candidates_[i];
    if (candidate.num_votes < min_votes || IsTried(candidate.keyframe)) continue;
    if (atlas.keyframe(candidate.keyframe).map != accepted.map) continue;
    ++num_tried;
    if (TryNext(atlas, features, candidate, &rival_) != RelocalisationVerdict::kAccepted) continue;
    if (AreRivals(accepted.cam_from_map, rival_.cam_from_map, accepted.median_depth, recognition.rival_agreement)) {
      return true;
    }
  }
  return false;
}

RelocalisationVerdict Relocaliser::Try(const Atlas& atlas, const FrameFeatures& features, KeyframeHandle candidate,
                                       Relocalisation* out) {
  RelocalisationCounts& counts = out->counts;
  const int min_shared = config_.mapping.min_shared_points;
  CollectGroup(atlas, candidate, options_.group_size, min_shared, &covisible_, &group_);
  tried_.insert(tried_.end(), group_.begin(), group_.end());
  collector_.Collect(atlas, group_, &points_);
  points_.resize(std::min(points_.size(), static_cast<std::size_t>(device_.plan().max_match_list)));
  if (points_.empty()) return RelocalisationVerdict::kFewMatches;
  refs_.clear();
  for (const MapPointHandle point : points_) refs_.push_back(atlas.point(point).descriptor);
  std::int32_t num_matches = 0;
  MatchRequest request;
  request.query = DescriptorList::Whole(features.set);
  request.train = DescriptorList::Gather(refs_);
  request.options = {static_cast<float>(config_.matching.min_similarity), static_cast<float>(options_.max_angle_ratio),
                     true};
  request.matches = matches_;
  request.num_matches = &num_matches;
  if (!MatchAndWait(device_, Lane::kBackground, request).ok()) return RelocalisationVerdict::kDeviceFailed;
  counts.num_matches = num_matches;
  if (num_matches < options_.min_matches) return RelocalisationVerdict::kFewMatches;

  pairs_.clear();
  bearings_.clear();
  for (std::int32_t m = 0; m < num_matches; ++m) {
    pairs_.push_back({matches_[m].query, points_[matches_[m].train]});
    bearings_.push_back(features.bearing(matches_[m].query));
  }
  ListPairs(atlas, features);
  AbsolutePoseRansac::Options ransac;
  ransac.max_iterations = options_.ransac_iterations;
  ransac.min_inliers = options_.min_ransac_inliers;
  AbsolutePoseRansac::Estimate estimate;
  if (!pose_from_matches_.Sample(bearings_, ransac, rng_, &estimate)) return RelocalisationVerdict::kNoPose;
  counts.num_ransac_inliers = estimate.num_inliers;
  PoseOptimizerResult result;
  if (!pose_from_matches_.Fit(estimate.cam_from_world, options_.min_ransac_inliers, &result)) {
    return RelocalisationVerdict::kNoPose;
  }
  counts.num_agreeing = result.num_inliers;
  if (counts.num_agreeing < options_.min_match_share * counts.num_matches) {
    return RelocalisationVerdict::kLowMatchShare;
  }

  CollectGroup(atlas, candidate, kWideViewGroup, min_shared, &covisible_, &wide_group_);
  collector_.Collect(atlas, wide_group_, &points_);
  searched_.clear();
  for (const MapPointHandle point : points_) searched_.push_back(AsSearched(atlas.point(point)));
  for (int round = 0; round < kGuidedPoseRounds; ++round) {
    int num_visible = 0;
    const Status status =
        search_.Search(searched_, Sim3{}, {features.set, result.cam_from_world, {}}, &found_, &num_visible);
    if (!status.ok()) return RelocalisationVerdict::kDeviceFailed;
    pairs_.clear();
    for (const FoundPoint& found : found_) pairs_.push_back({found.feature_idx, points_[found.point_idx]});
    counts.num_guided = static_cast<int>(pairs_.size());
    ListPairs(atlas, features);
    if (!pose_from_matches_.Fit(result.cam_from_world, options_.min_ransac_inliers, &result)) {
      return RelocalisationVerdict::kFewInliers;
    }
  }
  pose_from_matches_.KeepInliers(&pairs_);
  counts.num_inliers = static_cast<int>(pairs_.size());
  out->cam_from_map = result.cam_from_world;
  if (counts.num_inliers < options_.min_inliers) return RelocalisationVerdict::kFewInliers;
  if (counts.num_inliers < options_.min_inlier_share * counts.num_guided) {
    return RelocalisationVerdict::kLowInlierShare;
  }
  std::vector<Eigen::Vector2d> pixels;
  for (const Pair& pair : pairs_) pixels.push_back(features.pixel(pair.feature_idx));
  counts.spread = scene_.Spread(pixels);
  if (counts.spread < options_.min_spread) return RelocalisationVerdict::kLowSpread;
  if (const auto verdict = CheckCertainty(atlas, result, out); verdict != RelocalisationVerdict::kAccepted) {
    return verdict;
  }
  ChooseReference(atlas, out);
  return RelocalisationVerdict::kAccepted;
}

void Relocaliser::ListPairs(const Atlas& atlas, const FrameFeatures& features) {
  pose_from_matches_.Clear();
  for (const Pair& pair : pairs_) {
    pose_from_matches_.Add(atlas.point(pair.point).position, features.pixel(pair.feature_idx),
                           noise_.SigmaPx(features.keypoints[pair.feature_idx].scale_px));
  }
}

RelocalisationVerdict Relocaliser::CheckCertainty(const Atlas& atlas, const PoseOptimizerResult& result,
                                                  Relocalisation* out) const {
  std::vector<double> depths;
  for (const Pair& pair : pairs_) depths.push_back((result.cam_from_world * atlas.point(pair.point).position).norm());
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const PoseUncertainty uncertainty = UncertaintyOf(result.information, *middle);
  out->median_depth = *middle;
  out->counts.position_sigma = uncertainty.position_sigma;
  out->counts.rotation_sigma_deg = uncertainty.rotation_sigma_deg;
  const bool is_certain = uncertainty.position_sigma <= options_.max_position_sigma &&
                          uncertainty.rotation_sigma_deg <= options_.max_rotation_sigma_deg;
  return is_certain ? RelocalisationVerdict::kAccepted : RelocalisationVerdict::kUncertain;
}

void Relocaliser::ChooseReference(const Atlas& atlas, Relocalisation* out) const {
  int best = -1;
  for (const KeyframeHandle handle : wide_group_) {
    int num_shared = 0;
    for (const Pair& pair : pairs_) {
      if (atlas.FeatureOf(atlas.point(pair.point), handle) >= 0) ++num_shared;
    }
    if (num_shared > best) {
      best = num_shared;
      out->reference = handle;
    }
  }
}

}  // namespace haustra
