#include "engine/tracking/pose_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "engine/camera/view_queries.h"
#include "engine/geometry/constants.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// Of the points searched one in so many is searched in a wrong place, too: what is found there is chance.
constexpr int kDecoyStep = 4;
constexpr double kChanceMemory = 0.7;  // per frame
// A pose with less than this share of the last one's points is looked at again, in windows of this share of the first
// ones.
constexpr double kThinShare = 0.6;
constexpr double kLookAroundShare = 0.5;
// Inliers beyond chance have to be so many times the spread of chance itself.
constexpr double kChanceSigmas = 3.0;
// Of the matches, or of the established points that should be seen where these are fewer. A false pose had 0.13 of its
// matches; ninety others, rendered and of living tissue, 0.47 of the matches or 0.6 of what should be seen.
constexpr double kEstablishedShare = 1.0 / 3.0;
// Of the seasoned points that should be seen. It counts where they are few: in the first seconds of a map, and where
// the scope goes on to new wall.
constexpr double kSeasonedShare = 0.1;

}  // namespace

LastFrame::LastFrame(int max_features, std::pmr::memory_resource* memory) : features(max_features, memory) {
  ReserveTouched(&matches, static_cast<std::size_t>(max_features));
}

PoseSearch::PoseSearch(const Parts& parts)
    : parts_(parts),
      motion_radius_px_(parts.config.tracking.motion_radius_deg * kDegree * parts.camera.focal_px()),
      pose_from_matches_(parts.camera, parts.config.features.max) {
  const auto num_features = static_cast<std::size_t>(parts.config.features.max);
  const auto num_points = static_cast<std::size_t>(parts.config.memory.max_local_points);
  ReserveTouched(&estimate_.matches, num_features);
  ReserveTouched(&narrow_.matches, num_features);
  ReserveTouched(&seeds_, num_features);
  ReserveTouched(&queries_, std::max(num_points, num_features));
  ReserveTouched(&decoys_, num_points);
  ReserveTouched(&query_points_, std::max(num_points, num_features));
  found_.resize(std::max(num_points, num_features));
  allowed_.resize(num_features);
  is_matched_point_.resize(num_points);
  ReserveTouched(&bearings_, num_features);
  ReserveTouched(&depths_, num_features);
}

std::size_t PoseSearch::BytesFor(int max_features, int max_points) {
  const auto features = static_cast<std::size_t>(max_features);
  const auto points = static_cast<std::size_t>(max_points);
  // Matches of estimate_, narrow_ and seeds_; bearings_, depths_; allowed_.
  constexpr std::size_t kOfFeature =
      PoseFromMatches::kBytesPerMatch + 3 * sizeof(PointMatch) + sizeof(Eigen::Vector3d) + sizeof(double) + 1;
  // decoys_, is_matched_point_; queries_, query_points_, found_.
  return features * kOfFeature + points * (sizeof(GuidedQuery) + 1) +
         std::max(features, points) * (sizeof(GuidedQuery) + sizeof(std::int32_t) + sizeof(Match));
}

void PoseSearch::Begin() {
  estimate_.matches.clear();
  seeds_.clear();
  has_given_up_ = false;
}

bool PoseSearch::SearchAroundPrediction(const SE3& predicted, const SE3& last_pose) {
  const FrameBudget::Timer timer(parts_.budget, Stage::kMotion);
  const double wide_px = motion_radius_px_ * parts_.config.tracking.wide_radius_factor;
  const std::pair<const SE3*, double> tries[] = {
      {&predicted, motion_radius_px_}, {&predicted, wide_px}, {&last_pose, wide_px}};
  bool is_found = false;
  for (int i = 0; i < 3 && !is_found && !has_no_time(); ++i) {
    // A frame that is late anyway is worth another try: what would be saved by giving up?
    has_given_up_ = i > 0 && !parts_.budget.is_over() && !parts_.budget.CanAfford(Stage::kMotion);
    is_found = !has_given_up_ && SearchLastFrame(*tries[i].first, tries[i].second);
  }
  seeds_.assign(estimate_.matches.begin(), estimate_.matches.end());
  return is_found;
}

bool PoseSearch::SearchLastFrame(const SE3& predicted, double radius_px) {
  estimate_.cam_from_map = predicted;
  estimate_.matches.clear();
  queries_.clear();
  query_points_.clear();
  const ViewQueries view_queries(parts_.config.matching, parts_.camera, parts_.noise, predicted);
  for (const auto& [feature_idx, handle] : parts_.last.matches) {
    const int point_idx = local_map().Find(handle);
    if (point_idx < 0) continue;
    GuidedQuery query;
    if (!view_queries.OfFeature(local_map().points[point_idx].position, {parts_.last.features.set, feature_idx},
                                parts_.last.features.keypoints[feature_idx].scale_px, radius_px, &query)) {
      continue;
    }
    queries_.push_back(query);
    query_points_.push_back(point_idx);
  }
  parts_.overlay.Allow(parts_.frame.features, allowed_);
  if (!RunGuided()) return false;
  if (static_cast<int>(estimate_.matches.size()) < parts_.config.tracking.min_motion_matches) return false;
  return FitMatches();
}

bool PoseSearch::SearchWithoutLastFrame(const SE3& predicted) {
  estimate_.cam_from_map = predicted;
  estimate_.matches.clear();
  return FitLocalMap(motion_radius_px_ * parts_.config.tracking.wide_radius_factor);
}

Stage PoseSearch::LocalMapStage() const {
  return parts_.budget.has_fewer_points() ? Stage::kLocalMapReduced : Stage::kLocalMap;
}

bool PoseSearch::FitLocalMap(double min_radius_px) {
  parts_.budget.ReconsiderPoints();
  const FrameBudget::Timer timer(parts_.budget, LocalMapStage());
  return SearchLocalMap(min_radius_px) && FitMatches();
}

bool PoseSearch::IsSuddenlyThin() const { return estimate_.matches.size() < kThinShare * parts_.last.matches.size(); }

// What is seen far away, in the middle of the picture, agrees with poses that are off along the line of sight; the near
// wall then lies outside every narrow window.
void PoseSearch::LookAround() {
  narrow_ = estimate_;
  bool has_pose = true;
  for (const double min_radius_px : {kLookAroundShare * motion_radius_px_, 0.0}) {
    has_pose = has_pose && SearchLocalMap(min_radius_px) && FitMatches();
    if (has_pose) KeepInliers();
  }
  // Matches that no pose was fitted to count for nothing.
  if (has_pose && estimate_.matches.size() > narrow_.matches.size()) return;
  estimate_ = narrow_;
}

bool PoseSearch::SearchLocalMap(double min_radius_px) {
  const FrameFeatures& features = parts_.frame.features;
  queries_.clear();
  query_points_.clear();
  decoys_.clear();
  parts_.overlay.Allow(features, allowed_);
  std::fill_n(is_matched_point_.begin(), local_map().num_points, std::uint8_t{0});
  for (const PointMatch& match : estimate_.matches) {
    allowed_[match.feature_idx] = 0;
    is_matched_point_[match.point_idx] = 1;
  }
  const ViewQueries view_queries(parts_.config.matching, parts_.camera, parts_.noise, estimate_.cam_from_map);
  const SchedulerConfig& scheduler = parts_.config.scheduler;
  estimate_.num_expected = estimate_.num_expected_seasoned = 0;
  const TimePoint well_seen = parts_.sight.WellSeen(local_map().map_id);
  // Reduced frames have nothing finer.
  const double min_expected_scale = features.is_reduced ? scheduler.reduced_min_scale_px : 0.0;
  // Fewer points: every n-th, others in the next frame.
  const std::uint32_t frame_index = parts_.frame.frame_index;
  const std::uint32_t step =
      parts_.budget.has_fewer_points() ? static_cast<std::uint32_t>(std::lround(1.0 / scheduler.reduced_share)) : 1;
  for (int i = 0; i < local_map().num_points; ++i) {
    if ((static_cast<std::uint32_t>(i) + frame_index) % step != 0 && is_matched_point_[i] == 0) continue;
    const LocalPoint& point = local_map().points[i];
    GuidedQuery query;
    double scale_px = 0.0;
    if (!view_queries.OfPoint(point, &query, &scale_px)) continue;
    const bool is_expected = local_map().is_established(point) && scale_px >= min_expected_scale;
    estimate_.num_expected += is_expected;
    estimate_.num_expected_seasoned += is_expected && point.established <= well_seen;
    if (static_cast<std::uint32_t>(i) / step % kDecoyStep == frame_index % kDecoyStep) {
      decoys_.push_back(Displaced(query, i % 2 == 0));
    }
    if (is_matched_point_[i] != 0) continue;
    query.radius_px = std::max(static_cast<float>(min_radius_px), query.radius_px);
    queries_.push_back(query);
    query_points_.push_back(i);
  }
  return RunGuided();
}

// The same search where the point certainly is not: as far from it as the widest window reaches and half as far again,
// towards the middle of the picture.
GuidedQuery PoseSearch::Displaced(GuidedQuery query, bool along_x) const {
  const auto distance = static_cast<float>(1.5 * motion_radius_px_ * parts_.config.tracking.wide_radius_factor);
  float& coordinate = along_x ? query.x_px : query.y_px;
  const float middle = 0.5f * static_cast<float>(along_x ? parts_.camera.width_px() : parts_.camera.height_px());
  coordinate += coordinate < middle ? distance : -distance;
  return query;
}

bool PoseSearch::MeasureChance() {
  num_searched_ = static_cast<double>(decoys_.size()) * kDecoyStep;
  // Short of time the last rate has to do.
  if (decoys_.empty() || (has_chance_rate_ && parts_.budget.has_fewer_points())) return true;
  if (parts_.lane.has_pending()) return false;  // a request that ran out of time still reads what is allowed
  parts_.overlay.Allow(parts_.frame.features, allowed_);
  if (!GuidedMatch(decoys_)) return false;
  const double rate = static_cast<double>(num_found_) / static_cast<double>(decoys_.size());
  chance_rate_ = has_chance_rate_ ? kChanceMemory * chance_rate_ + (1.0 - kChanceMemory) * rate : rate;
  has_chance_rate_ = true;
  return true;
}

bool PoseSearch::IsTrackedPoseEvident(bool is_confirmed) {
  const FrameBudget::Timer timer(parts_.budget, LocalMapStage());
  const TrackingConfig& tracking = parts_.config.tracking;
  // Young points were seen in the frames that the followed features come from: the two are one witness.
  const bool is_held = is_confirmed && estimate_.num_established >= tracking.min_inliers;
  return HasSeasonedWitnesses() && MeasureChance() &&
         HasEvidence(tracking.min_inliers, is_held ? tracking.min_detected : tracking.min_inliers);
}

bool PoseSearch::HasSeasonedWitnesses() const {
  const double asked = std::min<double>(parts_.config.tracking.min_seasoned,
                                        kSeasonedShare * static_cast<double>(estimate_.num_expected_seasoned));
  return local_map().is_young(parts_.config.mapping.min_map_keyframes) || estimate_.num_seasoned >= asked;
}

bool PoseSearch::HasEvidence(int min_inliers, int min_detected) const {
  const auto num_detected =
      std::count_if(estimate_.matches.begin(), estimate_.matches.end(),
                    [&](const PointMatch& match) { return parts_.frame.features.is_detected(match.feature_idx); });
  if (num_detected < min_detected) return false;
  const double chance = NumByChance();
  const double beyond = static_cast<double>(estimate_.matches.size()) - chance;
  return beyond >= std::max(static_cast<double>(min_inliers), kChanceSigmas * std::sqrt(chance));
}

bool PoseSearch::HasEstablishedWitnesses() const {
  const int could_be = std::min(static_cast<int>(estimate_.matches.size()), estimate_.num_expected);
  const bool is_young = local_map().is_young(parts_.config.mapping.min_map_keyframes);
  return (is_young ? estimate_.num_established : estimate_.num_seasoned) >= kEstablishedShare * could_be;
}

// Appends what the queries find to the matches.
bool PoseSearch::RunGuided() {
  if (!GuidedMatch(queries_)) return false;
  for (int i = 0; i < num_found_; ++i) {
    estimate_.matches.push_back({found_[i].train, query_points_[found_[i].query]});
  }
  return true;
}

// Fills found_ from the allowed features of the frame.
bool PoseSearch::GuidedMatch(std::span<const GuidedQuery> queries) {
  GuidedMatchRequest request;
  request.queries = queries;
  request.train = parts_.frame.features.set;
  request.train_allowed = {allowed_.data(), static_cast<std::size_t>(parts_.frame.features.num)};
  request.options = GuidedOptions(parts_.config.matching);
  request.matches = found_;
  request.num_matches = &num_found_;
  return parts_.lane.GuidedMatch(request, parts_.budget.wait_deadline()).ok();
}

void PoseSearch::ListMatch(const PointMatch& match) {
  const FrameFeatures& features = parts_.frame.features;
  pose_from_matches_.Add(local_map().points[match.point_idx].position, features.pixel(match.feature_idx),
                         parts_.noise.SigmaPx(features.keypoints[match.feature_idx].scale_px));
}

bool PoseSearch::AgreesWith(const SE3& cam_from_map, const PointMatch& match) const {
  Eigen::Vector2d pixel;
  if (!parts_.camera.Project(cam_from_map * local_map().points[match.point_idx].position, &pixel)) return false;
  const FrameFeatures& features = parts_.frame.features;
  const double sigma = parts_.noise.SigmaPx(features.keypoints[match.feature_idx].scale_px);
  return (pixel - features.pixel(match.feature_idx)).squaredNorm() <= kChi2TwoDof * sigma * sigma;
}

// Young points are many where something comes before the wall, and would outvote it. Those stay that agree with a pose
// of established points alone, from which the fit then goes on. Too few established ones: all have to do.
void PoseSearch::LetEstablishedLead() {
  std::vector<PointMatch>& matches = estimate_.matches;
  if (std::all_of(matches.begin(), matches.end(), [&](const PointMatch& m) { return is_established(m); })) return;
  pose_from_matches_.Clear();
  for (const PointMatch& match : matches) {
    if (is_established(match)) ListMatch(match);
  }
  PoseOptimizerResult led;
  if (!pose_from_matches_.Fit(estimate_.cam_from_map, parts_.config.tracking.min_inliers, &led)) return;
  estimate_.cam_from_map = led.cam_from_world;
  std::erase_if(matches, [&](const PointMatch& match) {
    return !is_established(match) && !AgreesWith(led.cam_from_world, match);
  });
}

bool PoseSearch::FitMatches() {
  LetEstablishedLead();
  pose_from_matches_.Clear();
  for (const PointMatch& match : estimate_.matches) ListMatch(match);
  PoseOptimizerResult fitted;
  fitted.cam_from_world = estimate_.cam_from_map;
  fitted.information = estimate_.information;
  const bool is_good = pose_from_matches_.Fit(estimate_.cam_from_map, kMinSeedInliers, &fitted);
  estimate_.cam_from_map = fitted.cam_from_world;
  estimate_.information = fitted.information;
  return is_good;
}

bool PoseSearch::SampleMatches(Rng& rng) {
  pose_from_matches_.Clear();
  bearings_.clear();
  for (const PointMatch& match : estimate_.matches) {
    ListMatch(match);
    bearings_.push_back(parts_.frame.features.bearing(match.feature_idx));
  }
  AbsolutePoseRansac::Options options;
  options.min_inliers = kMinSeedInliers;
  AbsolutePoseRansac::Estimate sampled;
  if (!pose_from_matches_.Sample(bearings_, options, rng, &sampled)) return false;
  estimate_.cam_from_map = sampled.cam_from_world;
  return true;
}

void PoseSearch::KeepInliers() {
  pose_from_matches_.KeepInliers(&estimate_.matches);
  CountMatches();
}

void PoseSearch::CountMatches() {
  const std::vector<PointMatch>& matches = estimate_.matches;
  depths_.clear();
  for (const PointMatch& match : matches) {
    depths_.push_back((estimate_.cam_from_map * local_map().points[match.point_idx].position).norm());
  }
  const TimePoint well_seen = parts_.sight.WellSeen(local_map().map_id);
  estimate_.num_established = estimate_.num_seasoned = 0;
  for (const PointMatch& match : matches) {
    estimate_.num_established += is_established(match);
    estimate_.num_seasoned += is_established(match) && local_map().points[match.point_idx].established <= well_seen;
  }
  if (depths_.empty()) return;
  std::nth_element(depths_.begin(), depths_.begin() + depths_.size() / 2, depths_.end());
  estimate_.median_depth = depths_[depths_.size() / 2];
}

int PoseSearch::NearestKeyframe() const {
  std::array<int, kMaxLocalKeyframes> votes{};
  for (const PointMatch& match : estimate_.matches) {
    std::uint64_t mask = local_map().points[match.point_idx].keyframe_mask;
    for (; mask != 0; mask &= mask - 1) ++votes[std::countr_zero(mask)];
  }
  return static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
}

}  // namespace haustra
