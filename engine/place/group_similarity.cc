#include "engine/place/group_similarity.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"

namespace haustra {
namespace {

// Finds a pose that one match in six supports, as relocalisation does.
constexpr int kPoseIterations = 1500;
// Of one keyframe's pose. Chance gave none over 33 pairs of places of a colon that only look alike; true ones of living
// tissue have 10 to 27.
constexpr int kMinPoseInliers = 10;
constexpr double kMapNoiseFactor = 2.0;
// A similarity that fewer than this share of the best one's matches agree with is a start that went astray.
constexpr double kRivalShare = 0.8;

}  // namespace

NoiseModel BetweenMaps(const NoiseModel& of_view) {
  NoiseModel noise = of_view;
  noise.k *= kMapNoiseFactor;
  noise.sigma_0_px *= kMapNoiseFactor;
  return noise;
}

GroupSimilarity::GroupSimilarity(const EngineConfig& config, const CommonAreaConfig& options, const NoiseModel& noise,
                                 const CameraModel& camera, GroupMatcher& matcher)
    : options_(options),
      noise_(noise),
      camera_(camera),
      matcher_(matcher),
      ransac_(config.features.max * options.group_size) {}

bool GroupSimilarity::Find(const GroupExcerpt& a, const GroupExcerpt& b, std::span<const SE3> views_b, Rng& rng,
                           Estimate* estimate) {
  matches_.clear();
  proposals_.clear();
  refined_.clear();
  views_a_.clear();
  for (int view = 0; view < a.num_keyframes; ++view) {
    if (!AddView(a, view, b, rng) && view == 0) return false;
  }
  if (static_cast<int>(proposals_.size()) < std::min(options_.min_group_poses, a.num_keyframes)) return false;
  inliers_.resize(matches_.size());
  Sim3OptimizerResult best;
  for (const Sim3& proposal : proposals_) {
    Sim3OptimizerResult result;
    if (!OptimizeSim3(camera_, matches_, views_a_, views_b, proposal, Sim3OptimizerOptions{}, inliers_, &result)) {
      continue;
    }
    if (result.num_inliers > best.num_inliers) best = result;
    refined_.push_back(result);
  }
  if (best.num_inliers < options_.min_inliers) return false;
  if (HasRival(best, a.first().cam_from_map.InverseTranslation())) return false;
  *estimate = {best.b_from_a, static_cast<int>(proposals_.size()), static_cast<int>(matches_.size()), best.num_inliers};
  return true;
}

bool GroupSimilarity::HasRival(const Sim3OptimizerResult& best, const Eigen::Vector3d& centre_in_a) {
  const Eigen::Vector3d centre = best.b_from_a * centre_in_a;
  ratios_.clear();
  for (const Sim3Match& match : matches_) ratios_.push_back((match.point_in_b - centre).norm());
  const auto middle = ratios_.begin() + static_cast<std::ptrdiff_t>(ratios_.size() / 2);
  std::nth_element(ratios_.begin(), middle, ratios_.end());
  return std::any_of(refined_.begin(), refined_.end(), [&](const Sim3OptimizerResult& other) {
    if (other.num_inliers < kRivalShare * best.num_inliers) return false;
    const double position = (other.b_from_a * centre_in_a - centre).norm() / *middle;
    const double rotation_deg = RotationAngle(other.b_from_a.rotation, best.b_from_a.rotation) / kDegree;
    const double scale = std::abs(std::log(other.b_from_a.scale / best.b_from_a.scale));
    return std::max({position / options_.max_position_sigma, rotation_deg / options_.max_rotation_sigma_deg,
                     scale / options_.max_scale_sigma}) > options_.max_group_disagreement;
  });
}

bool GroupSimilarity::AddView(const GroupExcerpt& a, int view_a, const GroupExcerpt& b, Rng& rng) {
  const KeyframeExcerpt& keyframe = a.keyframes[view_a];
  views_a_.push_back(keyframe.cam_from_map);
  if (!matcher_.Compare(keyframe, b, &found_).ok()) return false;
  const std::size_t begin = matches_.size();
  bearings_.clear();
  points_.clear();
  tolerance_.clear();
  for (const GroupMatch& found : found_) {
    const KeyframeExcerpt& keyframe_b = b.keyframes[found.view_b];
    const std::int32_t point_a = keyframe.points[found.feature_a], point_b = keyframe_b.points[found.feature_b];
    if (a.handles[point_a] == b.handles[point_b]) continue;  // one point already
    Eigen::Vector3d bearing;
    if (!camera_.Unproject(keyframe.pixel(found.feature_a), &bearing)) continue;
    const double sigma_a = noise_.SigmaPx(keyframe.keypoints[found.feature_a].scale_px);
    const double sigma_b = noise_.SigmaPx(keyframe_b.keypoints[found.feature_b].scale_px);
    matches_.push_back({a.points[point_a].position, b.points[point_b].position, keyframe.pixel(found.feature_a),
                        keyframe_b.pixel(found.feature_b), kMapNoiseFactor * sigma_a, kMapNoiseFactor * sigma_b, view_a,
                        found.view_b});
    bearings_.push_back(bearing);
    points_.push_back(b.points[point_b].position);
    tolerance_.push_back(std::sqrt(kChi2TwoDof) * sigma_a / camera_.focal_px());
  }
  AbsolutePoseRansac::Options options;
  options.max_iterations = kPoseIterations;
  options.min_inliers = kMinPoseInliers;
  AbsolutePoseRansac::Estimate pose;
  if (!ransac_.Run(bearings_, points_, tolerance_, options, rng, &pose)) return false;
  ratios_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (ransac_.inliers()[i] == 0) continue;
    ratios_.push_back((pose.cam_from_world * points_[i]).norm() /
                      (keyframe.cam_from_map * matches_[begin + i].point_in_a).norm());
  }
  const auto middle = ratios_.begin() + static_cast<std::ptrdiff_t>(ratios_.size() / 2);
  std::nth_element(ratios_.begin(), middle, ratios_.end());
  const Sim3 unit_b_from_a(*middle, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  proposals_.push_back(Sim3(pose.cam_from_world.Inverse()) * unit_b_from_a * Sim3(keyframe.cam_from_map));
  return true;
}

}  // namespace haustra
