#include "engine/tracking/tracker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace haustra {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kChi2TwoDof = 5.991;  // 95 %
// A pose from fewer points than this is not worth a search of the local map.
constexpr int kMinSeedInliers = 8;
constexpr int kMinFeatures = 30;
// The share of expected points that is found changes slowly with the view, but falls at once when something comes
// between scope and wall. Below this part of what is usual nothing that is seen may enter the map.
constexpr double kDegradedShare = 0.35;
// Below this part what still matches is as likely to be chance, blur or debris as the wall: no pose is better than
// this.
constexpr double kBlindShare = 0.15;
constexpr double kUsualShareMemory = 0.95;  // per frame
constexpr int kMinExpected = 60;
// A prediction over more lost frames than this is worth nothing.
constexpr int kMaxPredictedFrames = 3;

}  // namespace

Tracker::Tracker(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, TrackingLink& link,
                 double scene_share)
    : config_(config),
      camera_(camera),
      device_(device),
      link_(link),
      initialiser_(config, camera, device, scene_share),
      absolute_pose_(config.features.max),
      rng_(config.seed, 2),
      current_(config.features.max),
      last_(config.features.max) {
  const auto num_features = static_cast<std::size_t>(config.features.max);
  const auto num_points = static_cast<std::size_t>(config.memory.max_local_points);
  matches_.reserve(num_features);
  last_matches_.reserve(num_features);
  queries_.reserve(num_points);
  query_points_.reserve(num_points);
  found_.resize(std::max(num_points, num_features));
  allowed_.resize(num_features);
  is_matched_point_.resize(num_points);
  observations_.reserve(num_features);
  inliers_.resize(num_features);
  refs_.reserve(num_points);
  bearings_.reserve(num_features);
  points_.reserve(num_features);
  tolerance_.reserve(num_features);
  depths_.reserve(num_features);
}

Tracker::~Tracker() {
  initialiser_.Reset();
  if (owns_last_set_) device_.ReleaseFeatureSet(last_.set);
}

FrameResult Tracker::SkipDamaged(std::uint32_t frame_index, TimePoint timestamp) {
  FrameResult result;
  result.frame_index = frame_index;
  result.timestamp = timestamp;
  result.state = state_ == TrackingState::kInitialising ? TrackingState::kInitialising : TrackingState::kLost;
  result.reason = TrackingReason::kDamagedFrame;
  return result;
}

FrameResult Tracker::Track(const Frame& frame, TimePoint deadline) {
  FrameResult result;
  result.frame_index = frame.index;
  result.timestamp = frame.timestamp;
  ReadSnapshot();
  matches_.clear();
  if (!Extract(frame, deadline)) {
    SetLost();
    result.reason = TrackingReason::kDamagedFrame;
  } else if (current_.features.num < kMinFeatures) {
    SetLost();
    result.reason = TrackingReason::kFewFeatures;
  } else if (state_ == TrackingState::kTracking) {
    TrackMap(deadline, &result);
  } else {
    FindMap(deadline, &result);
  }
  result.state = state_;
  result.num_features = current_.features.num;
  if (state_ == TrackingState::kTracking) {
    FillPose(&result);
    if (IsClearView()) {
      LearnUsualShare();
      num_unclear_ = 0;
      ConsiderKeyframe(&result);
    }
  }
  EndFrame();
  link_.version_done.store(local_map().version, std::memory_order_release);
  return result;
}

bool Tracker::Extract(const Frame& frame, TimePoint deadline) {
  current_.frame_index = frame.index;
  current_.timestamp = frame.timestamp;
  current_.features.num = 0;
  current_is_proposed_ = false;
  const Result<FeatureSetHandle> set = device_.CreateFeatureSet();
  if (!set.ok()) {
    current_.features.set = FeatureSetHandle{};
    return false;
  }
  current_.features.set = *set;
  ExtractRequest request;
  request.image = frame.image;
  request.set = *set;
  request.keypoints = current_.features.keypoints;
  request.num_keypoints = &current_.features.num;
  if (!ExtractAndWait(device_, Lane::kTracking, request, deadline).ok()) {
    current_.features.num = 0;
    return false;
  }
  for (int i = 0; i < current_.features.num; ++i) {
    Eigen::Vector3d bearing;
    // A zero bearing agrees with no geometry, so a point outside the model is never used.
    if (!camera_.Unproject(current_.features.pixel(i), &bearing)) bearing.setZero();
    current_.features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                                     static_cast<float>(bearing.z())};
  }
  return true;
}

void Tracker::ReadSnapshot() {
  is_asking_ = link_.num_placeless_done.load(std::memory_order_acquire) < num_placeless_;
  link_.snapshots.Refresh();
  for (const Reframing& reframing : local_map().reframings) {
    if (reframing.sequence <= reframing_done_) continue;
    reframing_done_ = reframing.sequence;
    if (reframing.old_map_id != map_id_) continue;
    map_id_ = reframing.new_map_id;
    last_pose_ = TransformPose(last_pose_, reframing.new_from_old);
    last_keyframe_pose_ = TransformPose(last_keyframe_pose_, reframing.new_from_old);
    velocity_.translation *= reframing.new_from_old.scale;
  }
}

void Tracker::SetLost() {
  if (state_ == TrackingState::kTracking) state_ = TrackingState::kLost;
  has_velocity_ = false;
  num_unclear_ = 0;
  matches_.clear();
}

void Tracker::TrackMap(TimePoint deadline, FrameResult* result) {
  SE3 predicted = last_pose_;
  const int gap = static_cast<int>(current_.frame_index - last_pose_frame_);
  if (has_velocity_) {
    for (int i = 0; i < std::min(gap, kMaxPredictedFrames); ++i) predicted = velocity_ * predicted;
  }
  const double wide = config_.tracking.motion_radius_px * config_.tracking.wide_radius_factor;
  result->reason = TrackingReason::kTracked;
  bool has_pose = false;
  if (has_last_) {
    has_pose = SearchLastFrame(predicted, config_.tracking.motion_radius_px, deadline) ||
               SearchLastFrame(predicted, wide, deadline) || SearchLastFrame(last_pose_, wide, deadline);
  } else {
    pose_ = predicted;
    matches_.clear();
    has_pose = SearchLocalMap(wide, deadline) && OptimiseMatches();
  }
  if (has_pose) {
    KeepInliers();
    has_pose = SearchLocalMap(0.0, deadline) && OptimiseMatches();
    result->num_matches = static_cast<int>(matches_.size());
    KeepInliers();
    has_pose = has_pose && static_cast<int>(matches_.size()) >= config_.tracking.min_inliers;
    if (!has_pose) result->reason = TrackingReason::kFewInliers;
    if (has_pose && !IsPlausibleMotion(predicted)) {
      has_pose = false;
      result->reason = TrackingReason::kInconsistentMotion;
    }
  } else {
    result->reason = TrackingReason::kFewMatches;
  }
  if (!has_pose && config_.tracking.brute_force_recovery && RecoverPose(deadline)) {
    has_pose = true;
    has_velocity_ = false;
    result->reason = TrackingReason::kRecovered;
    result->num_matches = static_cast<int>(matches_.size());
  }
  if (has_pose && !IsClearView() && (++num_unclear_ > config_.tracking.max_unclear_frames || !SeesShare(kBlindShare))) {
    has_pose = false;
    result->reason = TrackingReason::kUnclearView;
  }
  if (!has_pose) SetLost();
}

void Tracker::FindMap(TimePoint deadline, FrameResult* result) {
  if (awaited_founding_ != 0) {
    if (local_map().founding_proposal == awaited_founding_) {
      Adopt();
      TrackMap(deadline, result);
      return;
    }
    if (local_map().refused_proposal != awaited_founding_) {
      result->reason = TrackingReason::kAwaitingMap;
      return;
    }
    awaited_founding_ = 0;
  }
  if (AdoptFoundFrame(deadline, result)) return;
  // While the mapper looks for a frame of ours its answer may change the map: then that is what counts.
  if (config_.tracking.brute_force_recovery && had_map_ && !is_asking_ && RecoverPose(deadline)) {
    initialiser_.Reset();
    state_ = TrackingState::kTracking;
    has_velocity_ = false;
    result->reason = TrackingReason::kRelocalised;
    result->num_matches = static_cast<int>(matches_.size());
    return;
  }
  matches_.clear();
  AskForPlace();
  if (!initialiser_.has_reference()) {
    initialiser_.SetReference(current_);
    current_is_proposed_ = true;
    result->reason = TrackingReason::kNoReference;
    return;
  }
  result->reason = initialiser_.Try(current_, deadline);
  result->num_matches = initialiser_.num_matches();
  result->num_inliers = initialiser_.num_inliers();
  if (result->reason == TrackingReason::kMapProposed) {
    ProposeMap();
  } else if (initialiser_.is_worn_out()) {
    initialiser_.SetReference(current_);
    current_is_proposed_ = true;
  } else {
    current_is_proposed_ = initialiser_.KeepBetween(current_);
  }
}

// The mapper has made the map: continue from its second founding view.
void Tracker::Adopt() {
  awaited_founding_ = 0;
  ContinueFrom(local_map().keyframes[0].cam_from_map, founding_frame_);
}

// The mapper has found an earlier frame in one of the maps: true when this one can be tracked from there.
bool Tracker::AdoptFoundFrame(TimePoint deadline, FrameResult* result) {
  const FoundFrame& found = local_map().found_frame;
  if (found.sequence == relocalisation_done_) return false;
  relocalisation_done_ = found.sequence;
  ContinueFrom(found.cam_from_map, found.frame_index);
  TrackMap(deadline, result);
  if (state_ != TrackingState::kTracking) return false;
  initialiser_.Reset();
  result->reason = TrackingReason::kRelocalised;
  return true;
}

// In the map of the snapshot, as if the frame had just been tracked.
void Tracker::ContinueFrom(const SE3& pose, std::uint32_t frame_index) {
  state_ = TrackingState::kTracking;
  had_map_ = true;
  map_id_ = local_map().map_id;
  last_pose_ = last_keyframe_pose_ = pose;
  last_pose_frame_ = last_keyframe_frame_ = frame_index;
  usual_share_ = 0.0;
  has_velocity_ = false;
  if (has_last_ && owns_last_set_) device_.ReleaseFeatureSet(last_.set);
  has_last_ = owns_last_set_ = false;
}

bool Tracker::SearchLastFrame(const SE3& predicted, double radius_px, TimePoint deadline) {
  pose_ = predicted;
  matches_.clear();
  queries_.clear();
  query_points_.clear();
  const auto tolerance = static_cast<float>(config_.matching.scale_tolerance);
  for (const auto& [feature_idx, handle] : last_matches_) {
    const int point_idx = local_map().Find(handle);
    if (point_idx < 0) continue;
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose_ * local_map().points[point_idx].position, &pixel) || !camera_.IsInImage(pixel)) continue;
    const float scale = last_.keypoints[feature_idx].scale_px;
    queries_.push_back({{last_.set, feature_idx},
                        static_cast<float>(pixel.x()),
                        static_cast<float>(pixel.y()),
                        static_cast<float>(radius_px),
                        scale / tolerance,
                        scale * tolerance});
    query_points_.push_back(point_idx);
  }
  std::fill_n(allowed_.begin(), current_.features.num, std::uint8_t{1});
  if (!RunGuided(deadline)) return false;
  if (static_cast<int>(matches_.size()) < config_.tracking.min_motion_matches) return false;
  return OptimiseMatches();
}

bool Tracker::SearchLocalMap(double min_radius_px, TimePoint deadline) {
  queries_.clear();
  query_points_.clear();
  std::fill_n(allowed_.begin(), current_.features.num, std::uint8_t{1});
  std::fill_n(is_matched_point_.begin(), local_map().num_points, std::uint8_t{0});
  for (const PointMatch& match : matches_) {
    allowed_[match.feature_idx] = 0;
    is_matched_point_[match.point_idx] = 1;
  }
  const Eigen::Vector3d centre = pose_.InverseTranslation();
  const double min_cos = std::cos(config_.matching.max_view_angle_deg * kDegree);
  const double tolerance = config_.matching.scale_tolerance;
  const double gate = std::sqrt(kChi2TwoDof);
  num_expected_ = 0;
  for (int i = 0; i < local_map().num_points; ++i) {
    const LocalPoint& point = local_map().points[i];
    const Eigen::Vector3d to_camera = centre - point.position;
    const double distance = to_camera.norm();
    if (distance <= 0.0 || point.normal.dot(to_camera) < min_cos * distance) continue;
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose_ * point.position, &pixel) || !camera_.IsInImage(pixel)) continue;
    const bool is_established = std::popcount(point.keyframe_mask) >= kEstablishedViews;
    num_expected_ += is_established;
    if (is_matched_point_[i] != 0) continue;
    const double scale = point.scale_times_distance / distance;
    queries_.push_back({point.descriptor, static_cast<float>(pixel.x()), static_cast<float>(pixel.y()),
                        static_cast<float>(std::max(min_radius_px, gate * config_.noise.SigmaPx(scale))),
                        static_cast<float>(scale / tolerance), static_cast<float>(scale * tolerance)});
    query_points_.push_back(i);
  }
  return RunGuided(deadline);
}

// Appends what the queries find to matches_.
bool Tracker::RunGuided(TimePoint deadline) {
  std::int32_t num_found = 0;
  GuidedMatchRequest request;
  request.queries = queries_;
  request.train = current_.features.set;
  request.train_allowed = {allowed_.data(), static_cast<std::size_t>(current_.features.num)};
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.guided_ratio), false};
  request.matches = found_;
  request.num_matches = &num_found;
  if (!GuidedMatchAndWait(device_, Lane::kTracking, request, deadline).ok()) return false;
  for (int i = 0; i < num_found; ++i) matches_.push_back({found_[i].train, query_points_[found_[i].query]});
  return true;
}

bool Tracker::OptimiseMatches() {
  observations_.clear();
  for (const PointMatch& match : matches_) {
    observations_.push_back({local_map().points[match.point_idx].position, current_.features.pixel(match.feature_idx),
                             config_.noise.SigmaPx(current_.features.keypoints[match.feature_idx].scale_px)});
  }
  PoseOptimizerResult optimised;
  const std::span<std::uint8_t> inliers(inliers_.data(), observations_.size());
  PoseOptimizerOptions options;
  options.chi2_gate = kChi2TwoDof;
  if (!OptimizePose(camera_, observations_, pose_, options, inliers, &optimised)) {
    std::fill(inliers.begin(), inliers.end(), std::uint8_t{0});
    return false;
  }
  pose_ = optimised.cam_from_world;
  return optimised.num_inliers >= kMinSeedInliers;
}

void Tracker::KeepInliers() {
  std::size_t kept = 0;
  depths_.clear();
  for (std::size_t i = 0; i < matches_.size(); ++i) {
    if (inliers_[i] == 0) continue;
    depths_.push_back((pose_ * local_map().points[matches_[i].point_idx].position).norm());
    matches_[kept++] = matches_[i];
  }
  matches_.resize(kept);
  num_established_ = static_cast<int>(std::count_if(matches_.begin(), matches_.end(), [&](const PointMatch& match) {
    return std::popcount(local_map().points[match.point_idx].keyframe_mask) >= kEstablishedViews;
  }));
  if (depths_.empty()) return;
  std::nth_element(depths_.begin(), depths_.begin() + depths_.size() / 2, depths_.end());
  median_depth_ = depths_[depths_.size() / 2];
}

bool Tracker::IsPlausibleMotion(const SE3& predicted) const {
  const double jump = (pose_.InverseTranslation() - predicted.InverseTranslation()).norm();
  return jump <= config_.tracking.max_jump_depth_ratio * median_depth_ &&
         RotationAngle(pose_.rotation, predicted.rotation) <= config_.tracking.max_jump_deg * kDegree;
}

// Everything in the picture against everything in the snapshot; no prediction is needed.
bool Tracker::SearchByBruteForce(TimePoint deadline) {
  matches_.clear();
  refs_.clear();
  for (int i = 0; i < local_map().num_points; ++i) refs_.push_back(local_map().points[i].descriptor);
  if (refs_.empty()) return false;
  std::int32_t num_found = 0;
  MatchRequest request;
  request.query = DescriptorList::Whole(current_.features.set);
  request.train = DescriptorList::Gather(refs_);
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.brute_force_ratio), true};
  request.matches = found_;
  request.num_matches = &num_found;
  if (!MatchAndWait(device_, Lane::kTracking, request, deadline).ok()) return false;
  for (int i = 0; i < num_found; ++i) matches_.push_back({found_[i].query, found_[i].train});
  return true;
}

bool Tracker::RecoverPose(TimePoint deadline) {
  if (!SearchByBruteForce(deadline)) return false;
  if (static_cast<int>(matches_.size()) < config_.tracking.min_inliers) return false;
  bearings_.clear();
  points_.clear();
  tolerance_.clear();
  const double gate = std::sqrt(kChi2TwoDof);
  for (const PointMatch& match : matches_) {
    bearings_.push_back(current_.features.bearing(match.feature_idx));
    points_.push_back(local_map().points[match.point_idx].position);
    const double sigma = config_.noise.SigmaPx(current_.features.keypoints[match.feature_idx].scale_px);
    tolerance_.push_back(gate * sigma / camera_.focal_px());
  }
  AbsolutePoseRansac::Options options;
  options.min_inliers = kMinSeedInliers;
  AbsolutePoseRansac::Estimate estimate;
  if (!absolute_pose_.Run(bearings_, points_, tolerance_, options, rng_, &estimate)) return false;
  pose_ = estimate.cam_from_world;
  std::copy(absolute_pose_.inliers().begin(), absolute_pose_.inliers().begin() + matches_.size(), inliers_.begin());
  KeepInliers();
  if (!OptimiseMatches()) return false;
  KeepInliers();
  if (!SearchLocalMap(0.0, deadline) || !OptimiseMatches()) return false;
  KeepInliers();
  return static_cast<int>(matches_.size()) >= config_.tracking.min_recovery_inliers && IsClearView();
}

// The keyframe of the window that shares most points with the frame.
int Tracker::NearestKeyframe() const {
  std::array<int, kMaxLocalKeyframes> votes{};
  for (const PointMatch& match : matches_) {
    std::uint64_t mask = local_map().points[match.point_idx].keyframe_mask;
    for (; mask != 0; mask &= mask - 1) ++votes[std::countr_zero(mask)];
  }
  return static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
}

void Tracker::FillPose(FrameResult* result) const {
  const LocalKeyframe& reference = local_map().keyframes[NearestKeyframe()];
  result->map_id = map_id_;
  result->cam_from_map = pose_;
  result->reference_keyframe = reference.id;
  result->cam_from_reference = pose_ * reference.cam_from_map.Inverse();
  result->reference_scale = reference.scale;
  result->num_inliers = static_cast<int>(matches_.size());
  result->num_expected = num_expected_;
  result->num_established = num_established_;
}

// Whether the frame shows what the map says it should: so much of what is usual.
bool Tracker::SeesShare(double share_of_usual) const {
  return num_expected_ < kMinExpected || num_established_ >= share_of_usual * usual_share_ * num_expected_;
}

bool Tracker::IsClearView() const { return SeesShare(kDegradedShare); }

void Tracker::LearnUsualShare() {
  if (num_expected_ < kMinExpected) return;
  const double share = static_cast<double>(num_established_) / num_expected_;
  usual_share_ = usual_share_ > 0.0 ? kUsualShareMemory * usual_share_ + (1.0 - kUsualShareMemory) * share : share;
}

void Tracker::ConsiderKeyframe(FrameResult* result) {
  const KeyframeConfig& options = config_.keyframes;
  const int spacing = static_cast<int>(current_.frame_index - last_keyframe_frame_);
  if (spacing < options.min_spacing_frames) return;
  if (link_.num_pending.load(std::memory_order_acquire) > 0) return;  // the mapper is busy
  const int num_tracked = static_cast<int>(matches_.size());
  const LocalKeyframe& reference = local_map().keyframes[NearestKeyframe()];
  const double baseline = (pose_.InverseTranslation() - last_keyframe_pose_.InverseTranslation()).norm();
  const double parallax_deg = std::atan2(baseline, median_depth_) / kDegree;
  const bool has_left_reference = num_established_ < options.min_tracked_ratio * reference.num_established;
  const bool is_thin = num_tracked < options.low_inliers;
  const bool has_moved = parallax_deg > options.min_parallax_deg;
  const bool is_late = spacing >= options.max_spacing_frames && parallax_deg > 0.25 * options.min_parallax_deg;
  if (has_left_reference || is_thin || has_moved || is_late) ProposeKeyframe(result);
}

void Tracker::ProposeKeyframe(FrameResult* result) {
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr) return;
  slot->kind = ProposalKind::kKeyframe;
  slot->map_id = map_id_;
  slot->cam_from_map = pose_;
  slot->reframing_done = reframing_done_;
  CopyView(current_, &slot->view);
  std::fill_n(slot->points.begin(), current_.features.num, MapPointHandle{});
  for (const PointMatch& match : matches_) {
    slot->points[match.feature_idx] = local_map().points[match.point_idx].handle;
  }
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
  current_is_proposed_ = true;
  last_keyframe_frame_ = current_.frame_index;
  last_keyframe_pose_ = pose_;
  result->is_keyframe = true;
}

void Tracker::ProposeMap() {
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr) return;
  slot->kind = ProposalKind::kFounding;
  slot->relocalisation_done = relocalisation_done_;
  slot->founding_id = awaited_founding_ = next_founding_id_++;
  CopyView(current_, &slot->view);
  initialiser_.MoveInto(slot);
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
  founding_frame_ = current_.frame_index;
  current_is_proposed_ = true;
}

// One frame at a time, when the mapper has nothing else to do.
void Tracker::AskForPlace() {
  if (link_.num_pending.load(std::memory_order_acquire) > 0) return;
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr || !device_.RetainFeatureSet(current_.features.set)) return;
  slot->kind = ProposalKind::kPlaceless;
  ++num_placeless_;
  CopyView(current_, &slot->view);
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
}

// The current frame becomes the last one.
void Tracker::EndFrame() {
  if (has_last_ && owns_last_set_) device_.ReleaseFeatureSet(last_.set);
  has_last_ = false;
  last_matches_.clear();
  if (state_ == TrackingState::kTracking) {
    const int gap = static_cast<int>(current_.frame_index - last_pose_frame_);
    if (gap > 0) {
      velocity_ = SE3::Exp((pose_ * last_pose_.Inverse()).Log() / gap);
      has_velocity_ = gap <= kMaxPredictedFrames;
    }
    last_pose_ = pose_;
    last_pose_frame_ = current_.frame_index;
    std::swap(last_, current_.features);
    has_last_ = true;
    owns_last_set_ = !current_is_proposed_;
    for (const PointMatch& match : matches_) {
      last_matches_.emplace_back(match.feature_idx, local_map().points[match.point_idx].handle);
    }
  } else if (!current_is_proposed_) {
    device_.ReleaseFeatureSet(current_.features.set);
  }
}

}  // namespace haustra
