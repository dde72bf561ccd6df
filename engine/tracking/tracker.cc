#include "engine/tracking/tracker.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/geometry/ellipse_spread.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// A pose from fewer points than this is not worth a search of the local map.
constexpr int kMinSeedInliers = 8;
constexpr int kMinFeatures = 30;
// Of the points searched one in so many is searched in a wrong place, too: what is found there is chance.
constexpr int kDecoyStep = 4;
constexpr double kChanceMemory = 0.7;  // per frame
// A pose with less than this share of the last one's points is looked at again, in windows of this share of the first
// ones.
constexpr double kThinShare = 0.6;
constexpr double kLookAroundShare = 0.5;
// Inliers beyond chance have to be so many times the spread of chance itself.
constexpr double kChanceSigmas = 3.0;
// After a loss there is no prediction that bears witness: inliers over those by chance. A false pose that was the best
// of many had 2, true ones had 8 and more.
constexpr double kChosenFactor = 4.0;
// A frame with fewer inliers than so many times the least that make a pose is nearly lost.
constexpr int kThinFactor = 2;
// A tracked pose with fewer inliers than so many times the least is questioned (decisions/2026-11-23-brute-force-bears-
// witness.md).
constexpr int kQuestionedFactor = 3;
// A prediction bears witness for its pose: this share of the brute-force matches that relocalisation asks for will do.
// On a phantom seen from afar a pose that was 6 degrees off had 0.35 of it, on living tissue true ones had 0.8 at
// least.
constexpr double kPredictedShare = 0.5;
// A prediction over more lost frames than this is worth nothing.
constexpr int kMaxPredictedFrames = 3;

}  // namespace

Tracker::Tracker(const EngineConfig& config, const CameraModel& camera, VisionDevice& device, TrackingLink& link,
                 const Clock* clock, double scene_share, std::pmr::memory_resource* memory)
    : config_(config),
      camera_(camera),
      device_(device),
      link_(link),
      budget_(config.scheduler, clock),
      lane_(device),
      noise_meter_(config.noise),
      motion_radius_px_(config.tracking.motion_radius_deg * kDegree * camera.focal_px()),
      overlay_(config.initialisation, config.features.finds_overlay, camera.width_px(), camera.height_px(),
               config.features.max),
      initialiser_(config, camera, device, lane_, overlay_, scene_share, memory),
      absolute_pose_(config.features.max),
      rng_(config.seed, 2),
      current_(config.features.max, memory),
      last_(config.features.max, memory) {
  const auto num_features = static_cast<std::size_t>(config.features.max);
  const auto num_points = static_cast<std::size_t>(config.memory.max_local_points);
  ReserveTouched(&matches_, num_features);
  ReserveTouched(&seeds_, num_features);
  ReserveTouched(&narrow_.matches, num_features);
  ReserveTouched(&questioned_.matches, num_features);
  ReserveTouched(&alike_, num_features);
  ReserveTouched(&pixels_, num_features);
  ReserveTouched(&last_matches_, num_features);
  ReserveTouched(&queries_, std::max(num_points, num_features));
  ReserveTouched(&decoys_, num_points);
  ReserveTouched(&query_points_, std::max(num_points, num_features));
  found_.resize(std::max(num_points, num_features));
  allowed_.resize(num_features);
  is_matched_point_.resize(num_points);
  ReserveTouched(&observations_, num_features);
  inliers_.resize(num_features);
  ReserveTouched(&refs_, num_points);
  ReserveTouched(&bearings_, num_features);
  ReserveTouched(&points_, num_features);
  ReserveTouched(&tolerance_, num_features);
  ReserveTouched(&depths_, num_features);
  ReserveTouched(&tracked_, num_features);
}

MemoryPlan Tracker::PlanMemory(const EngineConfig& config) {
  const auto features = static_cast<std::size_t>(config.features.max);
  const auto points = static_cast<std::size_t>(config.memory.max_local_points);
  const std::size_t views = 2 * FrameFeatures::BytesFor(config.features.max) +
                            Initialiser::BytesFor(config.features.max, config.initialisation.kept_views);
  // matches_, seeds_, narrow_, questioned_, alike_, last_matches_, allowed_, observations_, inliers_, bearings_,
  // points_, pixels_, tolerance_, depths_, tracked_; the robust estimators and what is compared in the initialiser.
  const std::size_t of_feature = 5 * sizeof(PointMatch) + sizeof(last_matches_[0]) + 2 + sizeof(PoseObservation) +
                                 2 * sizeof(Eigen::Vector3d) + 2 * sizeof(Eigen::Vector2d) + 2 * sizeof(double) +
                                 AbsolutePoseRansac::kBytesPerMatch + TwoViewRansac::kBytesPerMatch + sizeof(Match) +
                                 2 * sizeof(Eigen::Vector3d) + 3 * sizeof(double) + sizeof(OverlayWatch::Tracked);
  const std::size_t longest = std::max(features, points);
  const std::size_t workspace = OverlayWatch::BytesFor(config.features.max) + features * of_feature +
                                points * (1 + sizeof(DescriptorRef) + sizeof(GuidedQuery)) +
                                longest * (sizeof(GuidedQuery) + sizeof(std::int32_t) + sizeof(Match));
  MemoryPlan plan;
  plan.Add(MemoryPlace::kHostArena, "frames of tracking",
           static_cast<std::uint64_t>(3 + config.initialisation.kept_views), views,
           "features.max x initialisation.kept_views");
  plan.Add(MemoryPlace::kHost, "tracking workspace", 1, workspace, "features.max, memory.max_local_points");
  return plan;
}

Tracker::~Tracker() {
  lane_.Drain(kNoDeadline);
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
  budget_.BeginFrame(deadline, state_ == TrackingState::kTracking, NeedsAllFeatures());
  has_no_time_ = !lane_.Drain(budget_.wait_deadline());
  pose_stands_ = false;
  current_.frame_index = frame.index;
  current_.features.set = FeatureSetHandle{};
  current_.features.num = 0;
  if (!has_no_time_) Measure(frame, &result);
  has_no_time_ = has_no_time_ || (lane_.has_pending() && !pose_stands_);
  result.num_features = current_.features.num;
  if (has_no_time_) {
    AnswerWithoutMeasurement(&result);
    EndUnmeasuredFrame();
  } else {
    num_predicted_ = 0;
    if (state_ == TrackingState::kTracking) {
      FillPose(&result);
      MeasureNoise();
      WatchOverlay();
      ConsiderKeyframe(&result);
    }
    EndFrame();
  }
  result.state = state_;
  // What a request under way refers to is still in use.
  if (!lane_.has_pending()) link_.version_done.store(local_map().version, std::memory_order_release);
  budget_.EndFrame();
  result.rung = budget_.rung();
  result.times = budget_.times();
  return result;
}

// Lost, or nearly so: a young map was made of all features, and few would not find it again.
bool Tracker::NeedsAllFeatures() const {
  const bool is_thin = static_cast<int>(last_matches_.size()) < kThinFactor * config_.tracking.min_inliers;
  return state_ == TrackingState::kLost || (state_ == TrackingState::kTracking && is_thin);
}

void Tracker::Measure(const Frame& frame, FrameResult* result) {
  HearMapper();
  matches_.clear();
  seeds_.clear();
  if (!Extract(frame)) {
    if (lane_.has_pending()) return;
    SetLost();
    result->reason = TrackingReason::kDamagedFrame;
  } else if (current_.features.num < kMinFeatures) {
    SetLost();
    result->reason = TrackingReason::kFewFeatures;
  } else if (state_ == TrackingState::kTracking) {
    TrackMap(result);
  } else {
    FindMap(result);
  }
}

bool Tracker::Extract(const Frame& frame) {
  const bool has_fewer = budget_.has_fewer_features();
  const FrameBudget::Timer timer(budget_, has_fewer ? Stage::kExtractReduced : Stage::kExtract);
  current_.timestamp = frame.timestamp;
  current_is_proposed_ = false;
  const Result<FeatureSetHandle> set = device_.CreateFeatureSet();
  if (!set.ok()) {
    if (set.code() == StatusCode::kCapacityExceeded) num_sets_refused_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  current_.features.set = *set;
  current_.features.is_reduced = has_fewer;
  ExtractRequest request;
  request.image = frame.image;
  request.set = *set;
  request.keypoints = current_.features.keypoints;
  request.num_keypoints = &current_.features.num;
  if (has_fewer) {
    request.max_features = static_cast<int>(config_.scheduler.reduced_share * config_.features.max);
    request.min_scale_px = static_cast<float>(config_.scheduler.reduced_min_scale_px);
  }
  if (!lane_.Extract(request, budget_.wait_deadline()).ok()) {
    if (!lane_.has_pending()) current_.features.num = 0;
    return false;
  }
  for (int i = 0; i < current_.features.num; ++i) {
    Eigen::Vector3d bearing;
    // A zero bearing agrees with no geometry, so a point outside the model is never used.
    if (!camera_.Unproject(current_.features.pixel(i), &bearing)) bearing.setZero();
    current_.features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                                     static_cast<float>(bearing.z())};
  }
  overlay_.Blank(&current_.features);
  return true;
}

// The scope keeps its course, and the map its shape.
void Tracker::AnswerWithoutMeasurement(FrameResult* result) {
  budget_.StepDown(Rung::kPredicted);
  matches_.clear();
  result->reason = TrackingReason::kNoTime;
  if (state_ != TrackingState::kTracking) return;
  if (++num_predicted_ > config_.scheduler.max_predicted_frames || local_map().keyframes.empty()) {
    SetLost();
    return;
  }
  const auto& keyframes = local_map().keyframes;
  const auto* reference =
      std::find_if(keyframes.begin(), keyframes.end(), [&](const LocalKeyframe& k) { return k.id == last_reference_; });
  if (reference == keyframes.end()) reference = keyframes.begin();
  const SE3 predicted = Predict();
  result->reason = TrackingReason::kPredicted;
  result->map_id = map_id_;
  result->map_epoch = num_reframings_heard_;
  result->cam_from_map = predicted;
  result->reference_keyframe = reference->id;
  result->cam_from_reference = predicted * reference->cam_from_map.Inverse();
  result->reference_scale = reference->scale;
}

// Where the scope should be now, from its last measured pose and velocity.
SE3 Tracker::Predict() const {
  SE3 predicted = last_pose_;
  if (!has_velocity_) return predicted;
  const int gap = static_cast<int>(current_.frame_index - last_pose_frame_);
  for (int i = 0; i < std::min(gap, kMaxPredictedFrames); ++i) predicted = velocity_ * predicted;
  return predicted;
}

// The newest snapshot, and what the mapper has told up to it.
void Tracker::HearMapper() {
  link_.snapshots.Refresh();
  for (const VersionedReply* next = link_.replies.Front(); next != nullptr; next = link_.replies.Front()) {
    if (next->version > local_map().version) return;
    std::visit([this](const auto& reply) { Hear(reply); }, next->reply);
    link_.replies.Pop();
  }
}

void Tracker::Hear(const MapFounded& founded) {
  if (founded.proposal != awaited_founding_) return;
  awaited_founding_ = 0;
  start_ = Start{false, founded.map_id, founded.cam_from_map, founding_frame_};
}

void Tracker::Hear(const MapRefused& refused) {
  if (refused.proposal == awaited_founding_) awaited_founding_ = 0;
}

// A new map that is awaited is refused when the mapper comes to it.
void Tracker::Hear(const FrameFound& found) {
  is_asking_ = false;
  ++num_found_heard_;
  awaited_founding_ = 0;
  start_ = Start{true, found.map_id, found.cam_from_map, found.frame_index};
}

void Tracker::Hear(const Reframing& reframing) {
  ++num_reframings_heard_;
  if (start_) reframing.Carry(&start_->map_id, &start_->cam_from_map);
  MapId map_id = map_id_;
  if (!reframing.Carry(&map_id, &last_pose_)) return;
  reframing.Carry(&map_id_, &last_keyframe_pose_);
  overlay_map_ = kNoId;
  velocity_.translation *= reframing.new_from_old.scale;
}

void Tracker::SetLost() {
  if (state_ == TrackingState::kTracking) state_ = TrackingState::kLost;
  has_velocity_ = false;
  matches_.clear();
}

void Tracker::TrackMap(FrameResult* result) {
  const SE3 predicted = Predict();
  result->reason = TrackingReason::kTracked;
  bool has_pose = false;
  if (has_last_) {
    has_pose = SearchAroundPrediction(predicted);
    seeds_.assign(matches_.begin(), matches_.end());
  } else {
    pose_ = predicted;
    matches_.clear();
    has_pose = FitLocalMap(motion_radius_px_ * config_.tracking.wide_radius_factor);
  }
  if (has_pose) {
    KeepInliers();
    has_pose = FitLocalMap(0.0);
    result->num_matches = static_cast<int>(matches_.size());
    KeepInliers();
    if (has_pose && IsSuddenlyThin() && budget_.CanAfford(Stage::kLocalMap)) LookAround();
    if (!has_pose || static_cast<int>(matches_.size()) < config_.tracking.min_inliers) {
      has_pose = false;
      result->reason = TrackingReason::kFewInliers;
    } else if (!IsTrackedPoseEvident()) {
      has_pose = false;
      result->reason = TrackingReason::kWeakEvidence;
    }
    if (has_pose && !IsPlausibleMotion(predicted)) {
      has_pose = false;
      result->reason = TrackingReason::kInconsistentMotion;
    }
  } else {
    result->reason = TrackingReason::kFewMatches;
  }
  if (has_no_time_ || lane_.has_pending()) return;
  const bool is_questioned = static_cast<int>(matches_.size()) < kQuestionedFactor * config_.tracking.min_inliers;
  if (config_.tracking.brute_force_recovery && (!has_pose || is_questioned) && budget_.MayRecover(false)) {
    RecoverOrConfirm(&has_pose, result);
    pose_stands_ = has_pose;
  }
  if (lane_.has_pending()) return;
  if (!has_pose) SetLost();
}

void Tracker::FindMap(FrameResult* result) {
  if (awaited_founding_ != 0) {
    result->reason = TrackingReason::kAwaitingMap;
    return;
  }
  if (start_ && !start_->is_found) {
    ContinueFrom(*start_);
    TrackMap(result);
    return;
  }
  if (TryFoundFrame(result) || has_no_time_ || lane_.has_pending()) return;
  // While the mapper looks for a frame of ours its answer may change the map: then that is what counts.
  if (config_.tracking.brute_force_recovery && had_map_ && !is_asking_ && budget_.MayRecover(true) && RecoverPose()) {
    initialiser_.Reset();
    state_ = TrackingState::kTracking;
    has_velocity_ = false;
    result->reason = TrackingReason::kRelocalised;
    result->num_matches = static_cast<int>(matches_.size());
    return;
  }
  if (lane_.has_pending()) return;
  matches_.clear();
  AskForPlace();
  if (!initialiser_.has_reference()) {
    initialiser_.Keep(current_);
    current_is_proposed_ = true;
    result->reason = TrackingReason::kNoReference;
    return;
  }
  {
    const FrameBudget::Timer timer(budget_, Stage::kInitialise);
    result->reason = initialiser_.Try(current_, budget_.wait_deadline());
  }
  if (lane_.has_pending()) return;
  result->num_matches = initialiser_.num_matches();
  result->num_inliers = initialiser_.num_inliers();
  if (result->reason == TrackingReason::kMapProposed) {
    ProposeMap();
  } else {
    if (initialiser_.is_worn_out()) initialiser_.RenewReference();
    initialiser_.Keep(current_);
    current_is_proposed_ = true;
  }
}

// The mapper has found an earlier frame in one of the maps: true when this one can be tracked from there.
bool Tracker::TryFoundFrame(FrameResult* result) {
  if (!start_) return false;
  ContinueFrom(*start_);
  TrackMap(result);
  if (state_ != TrackingState::kTracking) return false;
  initialiser_.Reset();
  result->reason = TrackingReason::kRelocalised;
  return true;
}

// As if its frame had just been tracked.
void Tracker::ContinueFrom(const Start& start) {
  state_ = TrackingState::kTracking;
  had_map_ = true;
  map_id_ = start.map_id;
  last_pose_ = last_keyframe_pose_ = start.cam_from_map;
  last_pose_frame_ = start.frame_index;
  last_keyframe_time_ = current_.timestamp;
  start_.reset();
  has_velocity_ = false;
  if (has_last_ && owns_last_set_) device_.ReleaseFeatureSet(last_.set);
  has_last_ = owns_last_set_ = false;
}

// Near the prediction first, then further away, then around the last pose, while there is time.
bool Tracker::SearchAroundPrediction(const SE3& predicted) {
  const FrameBudget::Timer timer(budget_, Stage::kMotion);
  const double radius_px = motion_radius_px_;
  const double wide_px = radius_px * config_.tracking.wide_radius_factor;
  const std::pair<const SE3*, double> tries[] = {
      {&predicted, radius_px}, {&predicted, wide_px}, {&last_pose_, wide_px}};
  for (int i = 0; i < 3; ++i) {
    // A frame that is late anyway is worth another try: what would be saved by giving up?
    if (i > 0 && !budget_.is_over() && !budget_.CanAfford(Stage::kMotion)) {
      has_no_time_ = true;
      return false;
    }
    if (SearchLastFrame(*tries[i].first, tries[i].second)) return true;
    if (lane_.has_pending()) return false;
  }
  return false;
}

bool Tracker::SearchLastFrame(const SE3& predicted, double radius_px) {
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
  overlay_.Allow(current_.features, allowed_);
  if (!RunGuided()) return false;
  if (static_cast<int>(matches_.size()) < config_.tracking.min_motion_matches) return false;
  return OptimiseMatches();
}

Stage Tracker::LocalMapStage() const { return budget_.has_fewer_points() ? Stage::kLocalMapReduced : Stage::kLocalMap; }

bool Tracker::FitLocalMap(double min_radius_px) {
  budget_.ReconsiderPoints();
  const FrameBudget::Timer timer(budget_, LocalMapStage());
  return SearchLocalMap(min_radius_px) && OptimiseMatches();
}

// Far less of the map agrees with the pose than with the last one.
bool Tracker::IsSuddenlyThin() const { return matches_.size() < kThinShare * last_matches_.size(); }

// What is seen far away, in the middle of the picture, agrees with poses that are off along the line of sight; the near
// wall then lies outside every narrow window. So the window is widened once, and the better pose stays.
void Tracker::LookAround() {
  KeepPose(&narrow_);
  bool has_pose = true;
  for (const double min_radius_px : {kLookAroundShare * motion_radius_px_, 0.0}) {
    has_pose = has_pose && SearchLocalMap(min_radius_px) && OptimiseMatches();
    if (has_pose) KeepInliers();
  }
  // Matches that no pose was fitted to count for nothing.
  if (has_pose && matches_.size() > narrow_.matches.size()) return;
  ReturnTo(narrow_);
}

void Tracker::KeepPose(KeptPose* kept) const {
  kept->matches.assign(matches_.begin(), matches_.end());
  kept->pose = pose_;
  kept->information = information_;
  kept->num_expected = num_expected_;
}

void Tracker::ReturnTo(const KeptPose& kept) {
  matches_.assign(kept.matches.begin(), kept.matches.end());
  pose_ = kept.pose;
  information_ = kept.information;
  num_expected_ = kept.num_expected;
  CountMatches();
}

bool Tracker::SearchLocalMap(double min_radius_px) {
  queries_.clear();
  query_points_.clear();
  decoys_.clear();
  overlay_.Allow(current_.features, allowed_);
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
  // Reduced frames have nothing finer.
  const double min_expected_scale = current_.features.is_reduced ? config_.scheduler.reduced_min_scale_px : 0.0;
  // Fewer points: every n-th, others in the next frame.
  const std::uint32_t step =
      budget_.has_fewer_points() ? static_cast<std::uint32_t>(std::lround(1.0 / config_.scheduler.reduced_share)) : 1;
  for (int i = 0; i < local_map().num_points; ++i) {
    if ((static_cast<std::uint32_t>(i) + current_.frame_index) % step != 0 && is_matched_point_[i] == 0) continue;
    const LocalPoint& point = local_map().points[i];
    const Eigen::Vector3d to_camera = centre - point.position;
    const double distance = to_camera.norm();
    if (distance <= 0.0 || point.normal.dot(to_camera) < min_cos * distance) continue;
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose_ * point.position, &pixel) || !camera_.IsInImage(pixel)) continue;
    const double scale = point.scale_times_distance / distance;
    num_expected_ += std::popcount(point.keyframe_mask) >= kEstablishedViews && scale >= min_expected_scale;
    GuidedQuery query = {point.descriptor,
                         static_cast<float>(pixel.x()),
                         static_cast<float>(pixel.y()),
                         static_cast<float>(gate * noise().SigmaPx(scale)),
                         static_cast<float>(scale / tolerance),
                         static_cast<float>(scale * tolerance)};
    if (static_cast<std::uint32_t>(i) / step % kDecoyStep == current_.frame_index % kDecoyStep) {
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
GuidedQuery Tracker::Displaced(GuidedQuery query, bool along_x) const {
  const auto distance = static_cast<float>(1.5 * motion_radius_px_ * config_.tracking.wide_radius_factor);
  float& coordinate = along_x ? query.x_px : query.y_px;
  const float middle = 0.5f * static_cast<float>(along_x ? camera_.width_px() : camera_.height_px());
  coordinate += coordinate < middle ? distance : -distance;
  return query;
}

// How many of the local map's points would be found by chance. False: the device has not answered.
bool Tracker::MeasureChance() {
  num_searched_ = static_cast<double>(decoys_.size()) * kDecoyStep;
  // Short of time the last rate has to do.
  if (decoys_.empty() || (has_chance_rate_ && budget_.has_fewer_points())) return true;
  overlay_.Allow(current_.features, allowed_);
  if (!GuidedMatch(decoys_)) return false;
  const double rate = static_cast<double>(num_found_) / static_cast<double>(decoys_.size());
  chance_rate_ = has_chance_rate_ ? kChanceMemory * chance_rate_ + (1.0 - kChanceMemory) * rate : rate;
  has_chance_rate_ = true;
  return true;
}

double Tracker::NumByChance() const { return chance_rate_ * num_searched_; }

bool Tracker::IsTrackedPoseEvident() {
  const FrameBudget::Timer timer(budget_, LocalMapStage());
  return MeasureChance() && HasEvidence(config_.tracking.min_inliers);
}

// A pose is known when more of the map agrees with it than chance would give, by a margin that chance does not reach.
bool Tracker::HasEvidence(int min_inliers) const {
  const double chance = NumByChance();
  const double beyond = static_cast<double>(matches_.size()) - chance;
  return beyond >= std::max(static_cast<double>(min_inliers), kChanceSigmas * std::sqrt(chance));
}

// Appends what the queries find to matches_.
bool Tracker::RunGuided() {
  if (!GuidedMatch(queries_)) return false;
  for (int i = 0; i < num_found_; ++i) matches_.push_back({found_[i].train, query_points_[found_[i].query]});
  return true;
}

// Fills found_ from the allowed features of the frame.
bool Tracker::GuidedMatch(std::span<const GuidedQuery> queries) {
  GuidedMatchRequest request;
  request.queries = queries;
  request.train = current_.features.set;
  request.train_allowed = {allowed_.data(), static_cast<std::size_t>(current_.features.num)};
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.guided_ratio), false};
  request.matches = found_;
  request.num_matches = &num_found_;
  return lane_.GuidedMatch(request, budget_.wait_deadline()).ok();
}

bool Tracker::OptimiseMatches() {
  observations_.clear();
  for (const PointMatch& match : matches_) {
    observations_.push_back({local_map().points[match.point_idx].position, current_.features.pixel(match.feature_idx),
                             noise().SigmaPx(current_.features.keypoints[match.feature_idx].scale_px)});
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
  information_ = optimised.information;
  return optimised.num_inliers >= kMinSeedInliers;
}

// What the points of the last frame leave at the pose that was found.
void Tracker::MeasureNoise() {
  for (const PointMatch& seed : seeds_) {
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose_ * local_map().points[seed.point_idx].position, &pixel)) continue;
    noise_meter_.Add((pixel - current_.features.pixel(seed.feature_idx)).norm(),
                     current_.features.keypoints[seed.feature_idx].scale_px);
  }
  // The time without a pose does not age what was measured before: the video is the same.
  noise_meter_.EndFrame(has_velocity_ ? ToSeconds(current_.timestamp - last_timestamp_) : 0.0);
  last_timestamp_ = current_.timestamp;
}

// What stands still in front of the scene, by an earlier frame of the same map.
void Tracker::WatchOverlay() {
  if (!overlay_.is_due(current_.timestamp)) return;
  if (overlay_.has_frame() && overlay_map_ == map_id_) {
    tracked_.clear();
    for (const PointMatch& match : matches_) {
      Eigen::Vector2d pixel;
      if (!camera_.Project(overlay_pose_ * local_map().points[match.point_idx].position, &pixel)) continue;
      tracked_.push_back({match.feature_idx, pixel.cast<float>()});
    }
    overlay_.Compare(current_.features, tracked_, current_.timestamp);
  }
  overlay_.KeepFrame(current_.features, current_.timestamp);
  overlay_pose_ = pose_;
  overlay_map_ = map_id_;
}

void Tracker::KeepInliers() {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < matches_.size(); ++i) {
    if (inliers_[i] != 0) matches_[kept++] = matches_[i];
  }
  matches_.resize(kept);
  CountMatches();
}

// How many of the matches are of established points, and how far away their points are.
void Tracker::CountMatches() {
  depths_.clear();
  for (const PointMatch& match : matches_) {
    depths_.push_back((pose_ * local_map().points[match.point_idx].position).norm());
  }
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
bool Tracker::SearchByBruteForce() {
  matches_.clear();
  alike_.clear();
  refs_.clear();
  for (int i = 0; i < local_map().num_points; ++i) refs_.push_back(local_map().points[i].descriptor);
  if (refs_.empty()) return false;
  MatchRequest request;
  request.query = DescriptorList::Whole(current_.features.set);
  request.train = DescriptorList::Gather(refs_);
  request.options = {static_cast<float>(config_.matching.min_similarity),
                     static_cast<float>(config_.matching.brute_force_ratio), true};
  request.matches = found_;
  request.num_matches = &num_found_;
  if (!lane_.Match(request, budget_.wait_deadline()).ok()) return false;
  for (int i = 0; i < num_found_; ++i) matches_.push_back({found_[i].query, found_[i].train});
  alike_.assign(matches_.begin(), matches_.end());
  return true;
}

bool Tracker::RecoverPose() {
  const FrameBudget::Timer timer(budget_, Stage::kRecovery);
  if (!SearchByBruteForce()) return false;
  if (static_cast<int>(matches_.size()) < config_.tracking.min_inliers) return false;
  bearings_.clear();
  points_.clear();
  tolerance_.clear();
  const double gate = std::sqrt(kChi2TwoDof);
  for (const PointMatch& match : matches_) {
    bearings_.push_back(current_.features.bearing(match.feature_idx));
    points_.push_back(local_map().points[match.point_idx].position);
    const double sigma = noise().SigmaPx(current_.features.keypoints[match.feature_idx].scale_px);
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
  if (!SearchLocalMap(0.0) || !OptimiseMatches()) return false;
  KeepInliers();
  LookAround();
  if (!MeasureChance() || !HasEvidence(config_.tracking.min_recovery_inliers) || !IsChosenPoseEvident()) return false;
  if (state_ == TrackingState::kTracking) return true;
  // A pose that was chosen as the best of many agrees with more than chance gives a single one.
  return static_cast<double>(matches_.size()) >= kChosenFactor * NumByChance();
}

// Around a prediction a few points hold a wrong pose as well as the right one. Brute force knows no prediction: it
// finds the same pose or a better one, or agrees with the one that was tracked, or there is none.
void Tracker::RecoverOrConfirm(bool* has_pose, FrameResult* result) {
  KeepPose(&questioned_);
  if (RecoverPose() && (!*has_pose || matches_.size() > questioned_.matches.size())) {
    result->num_matches = static_cast<int>(matches_.size());
    if (*has_pose && IsQuestionedPoseConfirmed()) return;
    *has_pose = true;
    has_velocity_ = false;
    result->reason = TrackingReason::kRecovered;
    return;
  }
  if (!*has_pose) return;
  ReturnTo(questioned_);
  // Without an answer in time nothing speaks against it.
  if (lane_.has_pending() || BruteForceAgrees(kPredictedShare * config_.place.relocalisation.min_match_share)) return;
  *has_pose = false;
  result->reason = TrackingReason::kWeakEvidence;
}

// Two poses are one when most of what agreed with the first agrees with the second.
bool Tracker::IsQuestionedPoseConfirmed() {
  std::fill_n(is_matched_point_.begin(), local_map().num_points, std::uint8_t{0});
  for (const PointMatch& match : matches_) is_matched_point_[match.point_idx] = 1;
  const auto num = std::count_if(questioned_.matches.begin(), questioned_.matches.end(),
                                 [&](const PointMatch& match) { return is_matched_point_[match.point_idx] != 0; });
  return 2 * num > static_cast<std::ptrdiff_t>(questioned_.matches.size());
}

// Of what looks alike `min_share` has to lie where the pose says. Where walls are only alike, little does.
bool Tracker::BruteForceAgrees(double min_share) const {
  const auto agrees = [&](const PointMatch& match) {
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose_ * local_map().points[match.point_idx].position, &pixel)) return false;
    const double sigma = noise().SigmaPx(current_.features.keypoints[match.feature_idx].scale_px);
    return (pixel - current_.features.pixel(match.feature_idx)).squaredNorm() <= kChi2TwoDof * sigma * sigma;
  };
  const auto num = std::count_if(alike_.begin(), alike_.end(), agrees);
  return static_cast<double>(num) >= min_share * static_cast<double>(alike_.size());
}

// The gates of relocalisation: what agrees covers the picture and holds all six degrees of freedom.
bool Tracker::IsChosenPoseEvident() {
  const RelocalisationConfig& gates = config_.place.relocalisation;
  if (!BruteForceAgrees(gates.min_match_share)) return false;
  pixels_.clear();
  for (const PointMatch& match : matches_) pixels_.push_back(current_.features.pixel(match.feature_idx));
  if (EllipseSpread(pixels_, camera_.width_px(), camera_.height_px()) < gates.min_spread) return false;
  CountMatches();
  const PoseUncertainty uncertainty = UncertaintyOf(information_, median_depth_);
  return uncertainty.position_sigma <= gates.max_position_sigma &&
         uncertainty.rotation_sigma_deg <= gates.max_rotation_sigma_deg;
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

void Tracker::FillPose(FrameResult* result) {
  const LocalKeyframe& reference = local_map().keyframes[NearestKeyframe()];
  last_reference_ = reference.id;
  result->map_id = map_id_;
  result->map_epoch = num_reframings_heard_;
  result->cam_from_map = pose_;
  result->reference_keyframe = reference.id;
  result->cam_from_reference = pose_ * reference.cam_from_map.Inverse();
  result->reference_scale = reference.scale;
  result->num_inliers = static_cast<int>(matches_.size());
  result->num_expected = num_expected_;
  result->num_established = num_established_;
}

void Tracker::ConsiderKeyframe(FrameResult* result) {
  // A pose that was found without a prediction waits for the next frame to confirm it.
  if (result->reason != TrackingReason::kTracked) return;
  const KeyframeConfig& options = config_.keyframes;
  const double spacing_ms = ToMilliseconds(current_.timestamp - last_keyframe_time_);
  if (spacing_ms < options.min_spacing_ms) return;
  if (link_.num_pending.load(std::memory_order_acquire) > 0) return;  // the mapper is busy
  const int num_tracked = static_cast<int>(matches_.size());
  const LocalKeyframe& reference = local_map().keyframes[NearestKeyframe()];
  const double baseline = (pose_.InverseTranslation() - last_keyframe_pose_.InverseTranslation()).norm();
  const double parallax_deg = std::atan2(baseline, median_depth_) / kDegree;
  // What is left out is not lost from sight.
  const double reduced_share = config_.scheduler.reduced_share;
  const double share = (current_.features.is_reduced && !reference.is_reduced ? reduced_share : 1.0) *
                       (budget_.has_fewer_points() ? reduced_share : 1.0);
  const bool has_left_reference = num_established_ < options.min_tracked_ratio * share * reference.num_established;
  const bool is_thin = num_tracked < options.low_inliers;
  const bool has_moved = parallax_deg > options.min_parallax_deg;
  const bool is_late = spacing_ms >= options.max_spacing_ms && parallax_deg > 0.25 * options.min_parallax_deg;
  if (has_left_reference || is_thin || has_moved || is_late) ProposeKeyframe(result);
}

void Tracker::ProposeKeyframe(FrameResult* result) {
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr) return;
  slot->kind = ProposalKind::kKeyframe;
  slot->noise = noise();
  slot->map_id = map_id_;
  slot->cam_from_map = pose_;
  slot->num_reframings_heard = num_reframings_heard_;
  CopyView(current_, &slot->view);
  std::fill_n(slot->points.begin(), current_.features.num, MapPointHandle{});
  for (const PointMatch& match : matches_) {
    slot->points[match.feature_idx] = local_map().points[match.point_idx].handle;
  }
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
  current_is_proposed_ = true;
  last_keyframe_time_ = current_.timestamp;
  last_keyframe_pose_ = pose_;
  result->is_keyframe = true;
}

void Tracker::ProposeMap() {
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr) return;
  slot->kind = ProposalKind::kFounding;
  slot->noise = noise();
  slot->num_found_heard = num_found_heard_;
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
  if (is_asking_ || link_.num_pending.load(std::memory_order_acquire) > 0) return;
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr || !device_.RetainFeatureSet(current_.features.set)) return;
  slot->kind = ProposalKind::kPlaceless;
  slot->noise = noise();
  CopyView(current_, &slot->view);
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
  is_asking_ = true;
}

// The last frame that was measured stays the last one.
void Tracker::EndUnmeasuredFrame() {
  if (current_.features.set.is_valid() && !current_is_proposed_) lane_.ReleaseFeatureSet(current_.features.set);
  current_.features.set = FeatureSetHandle{};
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
