#include "engine/mapping/relief_check.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/rng_streams.h"
#include "engine/geometry/triangulation.h"

namespace haustra {
namespace {

// A pair contradicts when its own motion goes elsewhere, and fits better than the minimum next to the map's motion by
// so many matches. Nearer directions give much the same relief (two_view.cc).
constexpr double kOtherReliefRad = 0.5;
constexpr double kMinGain = 3.0;
// The map is contradicted when enough pairs tell, most of them against it, and what they do not explain falls by such a
// share.
constexpr int kMinPairs = 3;
constexpr double kMinShareAgainst = 0.75;
constexpr double kMinGainShare = 0.1;
// And only where rigid motions explain the pairs down to their noise, which leaves 0.24 of true matches. On a wall that
// moves by itself more is left, and any motion may fit best.
constexpr double kMaxLeft = 0.3;
// Of the map built anew: a keyframe needs so many points. Of the pairs it must leave less unexplained than the map
// does, and hardly more than their own motions do: where these do not go together, the wall moves by itself.
constexpr int kMinPlaced = 20;
constexpr double kMaxUnexplainedShare = 0.9;
constexpr double kMaxOverOwn = 1.1;
constexpr int kReliefIterations = 20;
// A point whose rays are nearer to parallel than this is left out: the next search finds it again.
constexpr double kMinParallaxRad = 0.15 * kDegree;

double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

}  // namespace

ReliefCheck::ReliefCheck(const EngineConfig& config, const NoiseModel& noise, const CameraModel& camera,
                         VisionDevice& device, SchurBundleAdjuster& adjuster)
    : config_(config),
      noise_(noise),
      camera_(camera),
      adjuster_(adjuster),
      pair_(config, noise, camera, device),
      ransac_(config.features.max),
      pose_ransac_(config.features.max),
      rng_(config.seed, rng_stream::kRelief),
      slots_(static_cast<std::size_t>(config.memory.max_keyframes), -1),
      place_of_(static_cast<std::size_t>(config.memory.max_map_points), -1) {}

bool ReliefCheck::Correct(KeyframeHandle handle, std::span<const Covisible> neighbours, Atlas* atlas) {
  if (!IsContradicted(handle, neighbours, *atlas)) return false;
  Begin(handle, *atlas);
  for (std::size_t i = 0; i < keyframes_.size(); ++i) poses_[i] = atlas->keyframe(keyframes_[i]).cam_from_map;
  for (Place& place : places_) place = {place.point, atlas->point(place.point).position, true};
  Solve(*atlas, &now_);
  for (Place& place : places_) place.is_known = false;
  PlacePair(*atlas);
  bool is_better = false;
  if (PlaceKeyframes(*atlas)) {
    Solve(*atlas, &turned_);
    const double now = Unexplained(now_, *atlas), turned = Unexplained(turned_, *atlas);
    is_better = turned < kMaxUnexplainedShare * now && turned < kMaxOverOwn * unexplained_by_own_;
  }
  if (is_better) WriteBack(atlas);
  for (const KeyframeHandle keyframe : keyframes_) slots_[keyframe.index] = -1;
  for (const Place& place : places_) place_of_[place.point.index] = -1;
  return is_better;
}

bool ReliefCheck::IsContradicted(KeyframeHandle handle, std::span<const Covisible> neighbours, const Atlas& atlas) {
  newest_ = handle;
  const Keyframe& a = atlas.keyframe(handle);
  int num_against = 0;
  told_.clear();
  double num_matches = 0.0, unexplained = 0.0, gained = 0.0, best_gain = 0.0;
  const auto num = std::min(neighbours.size(), static_cast<std::size_t>(config_.mapping.link_neighbours));
  for (const Covisible& neighbour : neighbours.first(num)) {
    const Keyframe& b = atlas.keyframe(neighbour.keyframe);
    TwoViewRansac::Estimate estimate;
    if (!pair_.Compare(a, b)) continue;
    if (!ransac_.Run(pair_.bearings_a(), pair_.bearings_b(), pair_.tolerance_rad(), {}, rng_, &estimate)) continue;
    SE3 of_map = b.cam_from_map * a.cam_from_map.Inverse();
    if (!(of_map.translation.norm() > 0.0)) continue;
    const double score = ransac_.Descend(&of_map);
    const double gain = estimate.score - score;
    told_.push_back(neighbour.keyframe);
    num_matches += static_cast<double>(pair_.matches().size());
    unexplained += static_cast<double>(pair_.matches().size()) - score;
    gained += gain;
    if (gain < kMinGain || Angle(of_map.translation, estimate.b_from_a.translation) < kOtherReliefRad) continue;
    ++num_against;
    if (gain <= best_gain) continue;
    best_gain = gain;
    other_ = neighbour.keyframe;
    other_from_newest_ = estimate.b_from_a;
    start_matches_.clear();
    start_points_.clear();
    for (std::size_t m = 0; m < pair_.matches().size(); ++m) {
      if (ransac_.inliers()[m] == 0) continue;
      start_matches_.push_back(pair_.matches()[m]);
      start_points_.push_back(ransac_.points_in_a()[m]);
    }
  }
  unexplained_by_own_ = unexplained - gained;
  const auto num_told = static_cast<int>(told_.size());
  return num_told >= kMinPairs && num_against >= kMinShareAgainst * num_told && gained >= kMinGainShare * unexplained &&
         unexplained_by_own_ <= kMaxLeft * num_matches;
}

void ReliefCheck::Begin(KeyframeHandle handle, const Atlas& atlas) {
  const auto& all = atlas.map(atlas.keyframe(handle).map).keyframes;
  keyframes_.assign(all.begin(), all.end());
  poses_.resize(keyframes_.size());
  is_placed_.assign(keyframes_.size(), 0);
  places_.clear();
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    const Keyframe& keyframe = atlas.keyframe(keyframes_[i]);
    slots_[keyframes_[i].index] = static_cast<std::int32_t>(i);
    for (int f = 0; f < keyframe.features.num; ++f) {
      const MapPointHandle point = keyframe.points[f];
      if (!point || place_of_[point.index] >= 0) continue;
      place_of_[point.index] = static_cast<std::int32_t>(places_.size());
      places_.push_back({point, Eigen::Vector3d::Zero(), false});
    }
  }
}

// The pair at the map's scale: the points that it shows are as far from the newest keyframe as they were, in the
// median.
void ReliefCheck::PlacePair(const Atlas& atlas) {
  const Keyframe& a = atlas.keyframe(newest_);
  const Keyframe& b = atlas.keyframe(other_);
  ratios_.clear();
  for (std::size_t m = 0; m < start_matches_.size(); ++m) {
    const MapPointHandle point = a.points[start_matches_[m].query];
    if (point) ratios_.push_back((a.cam_from_map * atlas.point(point).position).norm() / start_points_[m].norm());
  }
  double unit = 1.0;
  if (!ratios_.empty()) {
    std::nth_element(ratios_.begin(), ratios_.begin() + ratios_.size() / 2, ratios_.end());
    unit = ratios_[ratios_.size() / 2];
  }
  const SE3 map_from_a = a.cam_from_map.Inverse();
  for (std::size_t m = 0; m < start_matches_.size(); ++m) {
    for (const MapPointHandle point : {a.points[start_matches_[m].query], b.points[start_matches_[m].train]}) {
      if (!point || places_[place_of_[point.index]].is_known) continue;
      places_[place_of_[point.index]] = {point, map_from_a * Eigen::Vector3d(unit * start_points_[m]), true};
    }
  }
  SE3 b_from_a = other_from_newest_;
  b_from_a.translation *= unit;
  const auto place = [&](KeyframeHandle keyframe, const SE3& cam_from_map) {
    poses_[slots_[keyframe.index]] = cam_from_map;
    is_placed_[slots_[keyframe.index]] = 1;
  };
  place(newest_, a.cam_from_map);
  place(other_, b_from_a * a.cam_from_map);
}

bool ReliefCheck::PlaceKeyframes(const Atlas& atlas) {
  for (std::size_t i = 2; i < keyframes_.size(); ++i) {
    if (!PlaceNext(atlas)) return false;
    PlacePoints(atlas);
  }
  return true;
}

// Of the keyframes that are left, the one that sees most of the points that are known.
bool ReliefCheck::PlaceNext(const Atlas& atlas) {
  std::size_t next = 0;
  int most = 0;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    if (is_placed_[i] != 0) continue;
    const Keyframe& keyframe = atlas.keyframe(keyframes_[i]);
    int num = 0;
    for (int f = 0; f < keyframe.features.num; ++f) {
      if (keyframe.points[f] && places_[place_of_[keyframe.points[f].index]].is_known) ++num;
    }
    if (num > most) {
      most = num;
      next = i;
    }
  }
  if (most < kMinPlaced) return false;
  bearings_.clear();
  positions_.clear();
  tolerance_rad_.clear();
  const Keyframe& keyframe = atlas.keyframe(keyframes_[next]);
  for (int f = 0; f < keyframe.features.num; ++f) {
    if (!keyframe.points[f]) continue;
    const Place& place = places_[place_of_[keyframe.points[f].index]];
    if (!place.is_known) continue;
    bearings_.push_back(keyframe.features.bearing(f));
    positions_.push_back(place.position);
    tolerance_rad_.push_back(std::sqrt(kChi2TwoDof) * noise_.SigmaPx(keyframe.features.keypoints[f].scale_px) /
                             camera_.focal_px());
  }
  AbsolutePoseRansac::Options options;
  options.min_inliers = kMinPlaced;
  AbsolutePoseRansac::Estimate estimate;
  if (!pose_ransac_.Run(bearings_, positions_, tolerance_rad_, options, rng_, &estimate)) return false;
  poses_[next] = estimate.cam_from_world;
  is_placed_[next] = 1;
  return true;
}

void ReliefCheck::PlacePoints(const Atlas& atlas) {
  for (Place& place : places_) {
    if (!place.is_known) place.is_known = Triangulate(atlas.point(place.point), atlas, &place.position);
  }
}

// From the two keyframes whose rays differ most.
bool ReliefCheck::Triangulate(const MapPoint& point, const Atlas& atlas, Eigen::Vector3d* position) const {
  double widest = kMinParallaxRad;
  bool is_found = false;
  for (std::size_t i = 0; i < point.observations.size(); ++i) {
    const std::int32_t a = slots_[point.observations[i].keyframe.index];
    if (a < 0 || is_placed_[a] == 0) continue;
    for (std::size_t j = 0; j < i; ++j) {
      const std::int32_t b = slots_[point.observations[j].keyframe.index];
      if (b < 0 || is_placed_[b] == 0) continue;
      const auto bearing = [&](std::size_t k) {
        return atlas.keyframe(point.observations[k].keyframe).features.bearing(point.observations[k].feature_idx);
      };
      const SE3 b_from_a = poses_[b] * poses_[a].Inverse();
      Triangulated result;
      if (!TriangulateBearings(b_from_a, bearing(i), bearing(j), &result)) continue;
      const double parallax = std::acos(std::clamp(result.cos_parallax, -1.0, 1.0));
      if (parallax < widest) continue;
      widest = parallax;
      *position = poses_[a].Inverse() * result.point_in_a;
      is_found = true;
    }
  }
  return is_found;
}

void ReliefCheck::Fill(const Atlas& atlas, BundleProblem* problem) const {
  problem->poses.clear();
  problem->points.clear();
  problem->observations.clear();
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    problem->poses.push_back({poses_[i], keyframes_[i] == newest_});
  }
  for (const Place& place : places_) {
    const auto idx = static_cast<std::int32_t>(problem->points.size());
    problem->points.push_back({place.position, !place.is_known});
    if (!place.is_known) continue;
    for (const Observation& observation : atlas.point(place.point).observations) {
      const FrameFeatures& features = atlas.keyframe(observation.keyframe).features;
      problem->observations.push_back({slots_[observation.keyframe.index], idx, features.pixel(observation.feature_idx),
                                       noise_.SigmaPx(features.keypoints[observation.feature_idx].scale_px), false});
    }
  }
}

void ReliefCheck::Solve(const Atlas& atlas, BundleProblem* problem) {
  Fill(atlas, problem);
  BundleOptions options;
  options.max_iterations = kReliefIterations;
  // What fails leaves the poses as they were found, and is judged as well.
  (void)adjuster_.Adjust(camera_, options, problem);
}

// The observations of the map were chosen by its poses, and speak for them. The pairs were not.
double ReliefCheck::Unexplained(const BundleProblem& problem, const Atlas& atlas) {
  const auto pose = [&](KeyframeHandle keyframe) { return problem.poses[slots_[keyframe.index]].cam_from_world; };
  double unexplained = 0.0;
  for (const KeyframeHandle other : told_) {
    if (!pair_.Compare(atlas.keyframe(newest_), atlas.keyframe(other))) continue;
    const SE3 b_from_a = pose(other) * pose(newest_).Inverse();
    unexplained += static_cast<double>(pair_.matches().size()) -
                   EpipolarScore(b_from_a, pair_.bearings_a(), pair_.bearings_b(), pair_.tolerance_rad());
  }
  return unexplained;
}

void ReliefCheck::WriteBack(Atlas* atlas) const {
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    atlas->keyframe(keyframes_[i]).cam_from_map = turned_.poses[i].cam_from_world;
  }
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (places_[i].is_known) {
      atlas->point(places_[i].point).position = turned_.points[i].position;
    } else {
      atlas->RemovePoint(places_[i].point);
    }
  }
  for (const BundleObservation& observation : turned_.observations) {
    const MapPointHandle point = places_[observation.point_idx].point;
    if (observation.is_outlier && atlas->GetPoint(point) != nullptr) {
      atlas->RemoveObservation(point, keyframes_[observation.pose_idx]);
    }
  }
  for (const Place& place : places_) {
    if (atlas->GetPoint(place.point) != nullptr) atlas->UpdatePoint(place.point);
  }
}

}  // namespace haustra
