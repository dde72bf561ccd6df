#include "engine/place/common_area.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/geometry/constants.h"
#include "engine/geometry/rng_streams.h"

namespace haustra {
namespace {

// The first similarity comes from few matches; the second search profits from what the first one added.
constexpr int kGuidedRounds = 2;
// A correction smaller than this share of the depth needs no explanation by drift.
constexpr double kFreeDriftDepthShare = 0.2;

Eigen::Vector3d OpticalAxis(const SE3& cam_from_map) {
  return cam_from_map.rotation.conjugate() * Eigen::Vector3d::UnitZ();
}

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

std::string_view ToString(CommonAreaVerdict verdict) {
  switch (verdict) {
    case CommonAreaVerdict::kAccepted: return "accepted";
    case CommonAreaVerdict::kFewPoints: return "few_points";
    case CommonAreaVerdict::kDeviceFailed: return "device_failed";
    case CommonAreaVerdict::kFewMatches: return "few_matches";
    case CommonAreaVerdict::kMappedOnce: return "mapped_once";
    case CommonAreaVerdict::kNoSimilarity: return "no_similarity";
    case CommonAreaVerdict::kLowMatchShare: return "low_match_share";
    case CommonAreaVerdict::kFewInliers: return "few_inliers";
    case CommonAreaVerdict::kLowInlierShare: return "low_inlier_share";
    case CommonAreaVerdict::kLowVisibleShare: return "low_visible_share";
    case CommonAreaVerdict::kLowSpread: return "low_spread";
    case CommonAreaVerdict::kImplausibleScale: return "implausible_scale";
    case CommonAreaVerdict::kImplausibleView: return "implausible_view";
    case CommonAreaVerdict::kUncertain: return "uncertain";
    case CommonAreaVerdict::kUnconfirmed: return "unconfirmed";
    case CommonAreaVerdict::kImplausibleDrift: return "implausible_drift";
    case CommonAreaVerdict::kAmbiguous: return "ambiguous";
    case CommonAreaVerdict::kOutdated: return "outdated";
    case CommonAreaVerdict::kNotJoined: return "not_joined";
  }
  return "unknown";
}

CommonAreaVerifier::CommonAreaVerifier(const EngineConfig& config, const CommonAreaConfig& options,
                                       const NoiseModel& noise, const CameraModel& camera, const SceneRegion& scene,
                                       VisionDevice& device)
    : noise_(noise),
      tolerated_(noise),
      options_(options),
      camera_(camera),
      scene_(scene),
      ransac_(config.features.max),
      search_(config, tolerated_, camera, device),
      matcher_(config, options, device),
      group_similarity_(config, options, noise, camera, matcher_),
      group_rng_(config.seed, rng_stream::kGroups) {}

bool CommonAreaVerifier::Verify(const GroupExcerpt& a, const GroupExcerpt& b, Rng& rng, CommonArea* out) {
  *out = CommonArea{};
  tolerated_ = noise_;
  is_by_group_ = false;
  out->keyframe_a = a.keyframe;
  out->keyframe_b = b.keyframe;
  out->anchor_a = {a.first().cam_from_map, a.scale};
  out->anchor_b = {b.first().cam_from_map, b.scale};
  out->counts.keyframe_a = a.id;
  out->counts.keyframe_b = b.id;
  out->counts.map_a = a.map_id;
  out->counts.map_b = b.map_id;
  out->counts.num_points_a = a.num_points;
  out->counts.num_points_b = b.num_points;
  views_a_[0] = a.first().cam_from_map;
  views_b_.clear();
  for (int view = 0; view < b.num_keyframes; ++view) views_b_.push_back(b.keyframes[view].cam_from_map);
  out->counts.verdict = Run({a, b}, rng, out);
  return out->counts.verdict == CommonAreaVerdict::kAccepted;
}

CommonAreaVerdict CommonAreaVerifier::Run(const Sides& sides, Rng& rng, CommonArea* out) {
  CommonAreaCounts& counts = out->counts;
  if (std::min(counts.num_points_a, counts.num_points_b) < options_.min_points) return CommonAreaVerdict::kFewPoints;
  const auto matched = MatchGroup(sides, &counts.num_one);
  if (matched != CommonAreaVerdict::kAccepted) return matched;
  counts.num_matches = static_cast<int>(pairs_.size());
  if (counts.num_matches < options_.min_matches) return CommonAreaVerdict::kFewMatches;
  if (sides.a.map_id == sides.b.map_id && counts.num_matches < options_.min_doubled * counts.num_one) {
    return CommonAreaVerdict::kMappedOnce;
  }

  FillMatches(sides);
  Sim3OptimizerResult result;
  const CommonAreaVerdict first = FindSimilarity(sides, rng, &counts, &result);
  if (first == CommonAreaVerdict::kNoSimilarity) return first;
  out->b_from_a = result.b_from_a;
  if (first != CommonAreaVerdict::kAccepted) return first;

  for (int round = 0; round < kGuidedRounds; ++round) {
    const auto verdict = SearchBothWays(sides, result.b_from_a, &counts.num_visible);
    if (verdict != CommonAreaVerdict::kAccepted) return verdict;
    counts.num_guided = static_cast<int>(pairs_.size());
    if (counts.num_guided < options_.min_ransac_inliers) return CommonAreaVerdict::kFewInliers;
    if (!Refine(sides, result.b_from_a, &result)) return CommonAreaVerdict::kFewInliers;
  }
  KeepInliers();
  counts.num_inliers = static_cast<int>(pairs_.size());
  out->b_from_a = result.b_from_a;
  for (const Pair& pair : pairs_) {
    out->points.push_back({sides.a.handles[pair.point_a], sides.b.handles[pair.point_b]});
  }
  if (counts.num_inliers < options_.min_inliers) return CommonAreaVerdict::kFewInliers;
  if (counts.num_inliers < options_.min_inlier_share * counts.num_guided) return CommonAreaVerdict::kLowInlierShare;
  const double min_visible_share = is_by_group_ ? options_.min_group_visible_share : options_.min_visible_share;
  if (counts.num_inliers < min_visible_share * counts.num_visible) return CommonAreaVerdict::kLowVisibleShare;
  counts.spread = Spread(sides);
  if (counts.spread < options_.min_spread) return CommonAreaVerdict::kLowSpread;
  if (const auto verdict = CheckView(sides, result, out); verdict != CommonAreaVerdict::kAccepted) return verdict;
  if (const auto verdict = CheckNeighbours(sides, out); verdict != CommonAreaVerdict::kAccepted) return verdict;
  return CheckDrift(sides, out);
}

// From pairs of points, or where those do not tell it, from the poses of the keyframes around K_a.
CommonAreaVerdict CommonAreaVerifier::FindSimilarity(const Sides& sides, Rng& rng, CommonAreaCounts* counts,
                                                     Sim3OptimizerResult* result) {
  Sim3Ransac::Options ransac;
  ransac.max_iterations = options_.ransac_iterations;
  ransac.min_inliers = options_.min_ransac_inliers;
  ransac.chi2_gate = kChi2TwoDof;
  Sim3Ransac::Estimate estimate;
  if (ransac_.Run(camera_, matches_, views_a_, views_b_, ransac, rng, &estimate)) {
    counts->num_ransac_inliers = estimate.num_inliers;
    if (Refine(sides, estimate.b_from_a, result)) {
      counts->num_agreeing = result->num_inliers;
      const bool is_likely = counts->num_agreeing >= options_.min_match_share * counts->num_matches;
      return is_likely ? CommonAreaVerdict::kAccepted : CommonAreaVerdict::kLowMatchShare;
    }
  }
  // Inside one map tracking knows better: what its keyframes show in common is compact where the map has bent.
  if (sides.a.map_id == sides.b.map_id) return CommonAreaVerdict::kNoSimilarity;
  GroupSimilarity::Estimate group;
  if (!group_similarity_.Find(sides.a, sides.b, views_b_, group_rng_, &group)) return CommonAreaVerdict::kNoSimilarity;
  counts->num_agreeing = group.num_agreeing;
  result->b_from_a = group.b_from_a;
  tolerated_ = BetweenMaps(noise_);
  is_by_group_ = true;
  const bool is_likely = group.num_agreeing >= options_.min_match_share * group.num_matches;
  return is_likely ? CommonAreaVerdict::kAccepted : CommonAreaVerdict::kLowMatchShare;
}

CommonAreaVerdict CommonAreaVerifier::MatchGroup(const Sides& sides, int* num_one) {
  pairs_.clear();
  const KeyframeExcerpt& a = sides.a.first();
  if (!matcher_.Compare(a, sides.b, &group_matches_).ok()) return CommonAreaVerdict::kDeviceFailed;
  for (const GroupMatch& match : group_matches_) {
    pairs_.push_back({a.points[match.feature_a], sides.b.keyframes[match.view_b].points[match.feature_b],
                      match.feature_a, match.feature_b, match.view_b, 1, match.similarity});
  }
  *num_one = KeepOneToOne(sides);
  return CommonAreaVerdict::kAccepted;
}

void CommonAreaVerifier::MarkFeaturesWithPoint(const KeyframeExcerpt& keyframe) {
  allowed_.resize(static_cast<std::size_t>(keyframe.num));
  for (std::int32_t i = 0; i < keyframe.num; ++i) allowed_[i] = keyframe.points[i] >= 0 ? 1 : 0;
}

CommonAreaVerdict CommonAreaVerifier::SearchBothWays(const Sides& sides, const Sim3& b_from_a, int* num_visible) {
  pairs_.clear();
  const KeyframeExcerpt& a = sides.a.first();
  seen_in_a_.assign(sides.a.num_searched, -1);
  for (std::int32_t i = 0; i < a.num; ++i) {
    if (a.points[i] >= 0) seen_in_a_[a.points[i]] = i;
  }
  seen_in_b_.assign(sides.b.num_searched, Seen{});
  for (int view = sides.b.num_keyframes - 1; view >= 0; --view) {
    const KeyframeExcerpt& b = sides.b.keyframes[view];
    for (std::int32_t i = 0; i < b.num; ++i) {
      if (b.points[i] >= 0) seen_in_b_[b.points[i]] = {view, i};
    }
  }

  int visible_in_b = 0;
  for (int view = 0; view < sides.b.num_keyframes; ++view) {
    const KeyframeExcerpt& b = sides.b.keyframes[view];
    MarkFeaturesWithPoint(b);
    int visible = 0;
    const Status status =
        search_.Search(sides.a.searched(), b_from_a, {b.set, b.cam_from_map, allowed_}, &found_, &visible);
    if (!status.ok()) return CommonAreaVerdict::kDeviceFailed;
    if (view == 0) visible_in_b = visible;
    for (const FoundPoint& found : found_) {
      pairs_.push_back({found.point_idx, b.points[found.feature_idx], seen_in_a_[found.point_idx], found.feature_idx,
                        view, 1, found.similarity});
    }
  }

  MarkFeaturesWithPoint(a);
  int visible_in_a = 0;
  const Status status =
      search_.Search(sides.b.searched(), b_from_a.Inverse(), {a.set, a.cam_from_map, allowed_}, &found_, &visible_in_a);
  if (!status.ok()) return CommonAreaVerdict::kDeviceFailed;
  for (const FoundPoint& found : found_) {
    const Seen& seen = seen_in_b_[found.point_idx];
    pairs_.push_back({a.points[found.feature_idx], found.point_idx, found.feature_idx, seen.feature, seen.view, 1,
                      found.similarity});
  }
  *num_visible = std::min(visible_in_a, visible_in_b);
  KeepOneToOne(sides);
  return CommonAreaVerdict::kAccepted;
}

// Of pairs that contradict each other the one that was found more often stays, then the one that looks more alike.
int CommonAreaVerifier::KeepOneToOne(const Sides& sides) {
  const auto points_of = [&](const Pair& pair) {
    return std::tuple(sides.a.handles[pair.point_a].index, sides.b.handles[pair.point_b].index);
  };
  std::sort(pairs_.begin(), pairs_.end(), [&](const Pair& x, const Pair& y) {
    if (points_of(x) != points_of(y)) return points_of(x) < points_of(y);
    if (x.similarity != y.similarity) return x.similarity > y.similarity;
    return std::tuple(x.view_b, x.feature_a, x.feature_b) < std::tuple(y.view_b, y.feature_a, y.feature_b);
  });
  std::size_t num = 0;
  int num_one = 0;
  std::int64_t last_one = -1;
  for (const Pair& pair : pairs_) {
    const MapPointHandle point_a = sides.a.handles[pair.point_a];
    if (point_a == sides.b.handles[pair.point_b]) {
      num_one += point_a.index != last_one ? 1 : 0;
      last_one = point_a.index;
      continue;
    }
    if (num > 0 && points_of(pairs_[num - 1]) == points_of(pair)) {
      pairs_[num - 1].num_directions += pair.num_directions;
    } else {
      pairs_[num++] = pair;
    }
  }
  pairs_.resize(num);
  std::sort(pairs_.begin(), pairs_.end(), [&](const Pair& x, const Pair& y) {
    if (x.num_directions != y.num_directions) return x.num_directions > y.num_directions;
    if (x.similarity != y.similarity) return x.similarity > y.similarity;
    return points_of(x) < points_of(y);
  });
  num = 0;
  is_used_a_.assign(sides.a.points.size(), 0);
  is_used_b_.assign(sides.b.points.size(), 0);
  for (const Pair& pair : pairs_) {
    std::uint8_t& used_a = is_used_a_[pair.point_a];
    std::uint8_t& used_b = is_used_b_[pair.point_b];
    if (used_a != 0 || used_b != 0) continue;
    used_a = used_b = 1;
    pairs_[num++] = pair;
  }
  pairs_.resize(num);
  return num_one;
}

void CommonAreaVerifier::FillMatches(const Sides& sides) {
  matches_.clear();
  const KeyframeExcerpt& a = sides.a.first();
  for (const Pair& pair : pairs_) {
    const KeyframeExcerpt& b = sides.b.keyframes[pair.view_b];
    Sim3Match match;
    match.point_in_a = sides.a.points[pair.point_a].position;
    match.point_in_b = sides.b.points[pair.point_b].position;
    match.pixel_in_a = a.pixel(pair.feature_a);
    match.pixel_in_b = b.pixel(pair.feature_b);
    match.sigma_a_px = tolerated_.SigmaPx(a.keypoints[pair.feature_a].scale_px);
    match.sigma_b_px = tolerated_.SigmaPx(b.keypoints[pair.feature_b].scale_px);
    match.view_b = pair.view_b;
    matches_.push_back(match);
  }
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): it may be a part of *result.
bool CommonAreaVerifier::Refine(const Sides& sides, Sim3 initial, Sim3OptimizerResult* result) {
  FillMatches(sides);
  inliers_.resize(matches_.size());
  return OptimizeSim3(camera_, matches_, views_a_, views_b_, initial, Sim3OptimizerOptions{}, inliers_, result) &&
         result->num_inliers >= options_.min_ransac_inliers;
}

void CommonAreaVerifier::KeepInliers() {
  std::size_t num = 0;
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    if (inliers_[i] != 0) pairs_[num++] = pairs_[i];
  }
  pairs_.resize(num);
}

// The smaller share of the scope's window that the inliers cover, of both keyframes; what was matched in another view
// of the group counts where K_b sees the point.
double CommonAreaVerifier::Spread(const Sides& sides) const {
  std::vector<Eigen::Vector2d> pixels_a, pixels_b;
  const KeyframeExcerpt& a = sides.a.first();
  const KeyframeExcerpt& b = sides.b.first();
  for (const Pair& pair : pairs_) {
    pixels_a.push_back(a.pixel(pair.feature_a));
    Eigen::Vector2d pixel;
    if (camera_.Project(b.cam_from_map * sides.b.points[pair.point_b].position, &pixel) && camera_.IsInImage(pixel)) {
      pixels_b.push_back(pixel);
    }
  }
  return std::min(scene_.Spread(pixels_a), scene_.Spread(pixels_b));
}

CommonAreaVerdict CommonAreaVerifier::CheckView(const Sides& sides, const Sim3OptimizerResult& result,
                                                CommonArea* out) const {
  CommonAreaCounts& counts = out->counts;
  const Sim3& b_from_a = result.b_from_a;
  counts.scale = b_from_a.scale;
  const double ratio = std::max(b_from_a.scale, 1.0 / b_from_a.scale);
  if (!(ratio <= options_.max_scale_ratio)) return CommonAreaVerdict::kImplausibleScale;

  const SE3& pose_a = views_a_[0];
  counts.view_angle_deg = AngleBetween(b_from_a.rotation * OpticalAxis(pose_a), OpticalAxis(views_b_[0])) / kDegree;
  if (counts.view_angle_deg > options_.max_view_angle_deg) return CommonAreaVerdict::kImplausibleView;

  const Eigen::Vector3d centre = b_from_a * pose_a.InverseTranslation();
  std::vector<double> depths;
  for (const Pair& pair : pairs_) depths.push_back((sides.b.points[pair.point_b].position - centre).norm());
  std::nth_element(depths.begin(), depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2), depths.end());
  out->median_depth_in_b = depths[depths.size() / 2];

  // How far the estimate may be off, where it matters: at the camera. A step (rho, phi, lambda) moves its centre c by
  // rho + phi x c + lambda c.
  const Eigen::FullPivLU<Matrix7d> solver(result.information);
  if (!solver.isInvertible()) return CommonAreaVerdict::kUncertain;
  const Matrix7d covariance = solver.inverse();
  Eigen::Matrix<double, 3, 7> centre_from_step;
  centre_from_step << Eigen::Matrix3d::Identity(), -Skew(centre), centre;
  const double position_variance = (centre_from_step * covariance * centre_from_step.transpose()).trace();
  counts.position_sigma = std::sqrt(position_variance) / out->median_depth_in_b;
  counts.rotation_sigma_deg = std::sqrt(covariance.block<3, 3>(3, 3).trace()) / kDegree;
  counts.scale_sigma = std::sqrt(covariance(6, 6));
  const bool is_certain = counts.position_sigma <= options_.max_position_sigma &&
                          counts.rotation_sigma_deg <= options_.max_rotation_sigma_deg &&
                          counts.scale_sigma <= options_.max_scale_sigma;
  return is_certain ? CommonAreaVerdict::kAccepted : CommonAreaVerdict::kUncertain;
}

// The neighbours of K_a, moved by the same similarity, must find points of map b where their own points lie.
CommonAreaVerdict CommonAreaVerifier::CheckNeighbours(const Sides& sides, CommonArea* out) {
  CommonAreaCounts& counts = out->counts;
  const Sim3 a_from_b = out->b_from_a.Inverse();
  for (int k = 1; k < sides.a.num_keyframes; ++k) {
    ++counts.num_neighbours;
    const KeyframeExcerpt& keyframe = sides.a.keyframes[k];
    MarkFeaturesWithPoint(keyframe);
    int num_visible = 0;
    const Status status = search_.Search(sides.b.points, a_from_b, {keyframe.set, keyframe.cam_from_map, allowed_},
                                         &found_, &num_visible);
    if (!status.ok()) return CommonAreaVerdict::kDeviceFailed;
    int num_inliers = 0;
    for (const FoundPoint& found : found_) {
      const std::int32_t point_a = keyframe.points[found.feature_idx];
      if (sides.a.handles[point_a] == sides.b.handles[found.point_idx]) continue;
      // The neighbour's own point in the view of an observer of the other one.
      const PointSight& sight = sides.b.sights[found.point_idx];
      const Eigen::Vector3d position = out->b_from_a * sides.a.points[point_a].position;
      Eigen::Vector2d pixel;
      if (!camera_.Project(sight.cam_from_map * position, &pixel)) continue;
      const double sigma = tolerated_.SigmaPx(sight.scale_px);
      if ((pixel - sight.pixel).squaredNorm() <= kChi2TwoDof * sigma * sigma) ++num_inliers;
    }
    if (num_inliers >= options_.min_confirming_inliers) ++counts.num_confirming;
  }
  return counts.num_confirming >= std::min(options_.min_confirming, counts.num_neighbours)
             ? CommonAreaVerdict::kAccepted
             : CommonAreaVerdict::kUnconfirmed;
}

CommonAreaVerdict CommonAreaVerifier::CheckDrift(const Sides& sides, CommonArea* out) const {
  if (sides.a.map_id != sides.b.map_id) return CommonAreaVerdict::kAccepted;
  const double way = sides.b.way;
  const Eigen::Vector3d centre = sides.a.first().cam_from_map.InverseTranslation();
  const double drift = (out->b_from_a * centre - centre).norm();
  out->counts.drift_share = way > 0.0 ? drift / way : 0.0;
  const double rotation_deg = RotationAngle(out->b_from_a.rotation, Eigen::Quaterniond::Identity()) / kDegree;
  const double scale = std::max(out->b_from_a.scale, 1.0 / out->b_from_a.scale);
  const bool is_small = drift <= kFreeDriftDepthShare * out->median_depth_in_b;
  const bool is_plausible = (is_small || drift <= options_.max_drift_share * way) &&
                            rotation_deg <= options_.max_drift_deg && scale <= options_.max_drift_scale;
  return is_plausible ? CommonAreaVerdict::kAccepted : CommonAreaVerdict::kImplausibleDrift;
}

}  // namespace haustra
