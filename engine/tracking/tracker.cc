#include "engine/tracking/tracker.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"
#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

constexpr int kMinFeatures = 30;
// A frame with fewer inliers than so many times the least that make a pose is nearly lost.
constexpr int kThinFactor = 2;
// A tracked pose with fewer inliers than so many times the least is questioned (decisions/2026-11-23-brute-force-bears-
// witness.md).
constexpr int kQuestionedFactor = 3;
// A frame with so many of the inliers of the anchor becomes the anchor; one with fewer is judged by it.
constexpr double kAnchorShare = 0.8;
// The points of an older anchor are gone, or few; where the map has thinned out, that is how it is.
constexpr double kMaxAnchorMs = 240.0;
// A velocity older than this is worth nothing.
constexpr double kMaxVelocityMs = 120.0;

}  // namespace

Tracker::Tracker(const EngineConfig& config, const CameraModel& camera, SceneRegion& scene, VisionDevice& device,
                 TrackingLink& link, const Clock* clock, std::pmr::memory_resource* memory)
    : config_(config),
      camera_(camera),
      scene_(scene),
      device_(device),
      link_(link),
      current_(config.features.max, memory),
      last_(config.features.max, memory),
      budget_(config.scheduler, clock),
      lane_(device),
      noise_meter_(config.noise),
      sight_(config.keyframes.low_inliers),
      overlay_(config.initialisation, config.features.finds_overlay, camera.width_px(), camera.height_px(),
               config.features.max),
      chain_(camera, config.features.max),
      extractor_({config, camera, device, lane_, budget_, overlay_, current_, last_, chain_}),
      initialiser_(config, camera, device, lane_, overlay_, scene, memory),
      search_({config, camera, scene, lane_, budget_, overlay_, noise_meter_.model(), sight_, link.snapshots, current_,
               last_}),
      recovery_({config, camera, scene, lane_, budget_, overlay_, noise_meter_.model(), sight_, link.snapshots,
                 current_, last_},
                search_),
      marks_(camera, scene, config.features.max),
      proposer_(config, device, link, noise_meter_.model(), current_, heard_) {
  ReserveTouched(&tracked_, static_cast<std::size_t>(config.features.max));
}

MemoryPlan Tracker::PlanMemory(const EngineConfig& config) {
  const int max_features = config.features.max;
  const auto features = static_cast<std::size_t>(max_features);
  const std::size_t views =
      2 * FrameFeatures::BytesFor(max_features) + Initialiser::BytesFor(max_features, config.initialisation.kept_views);
  // Matches of the last frame, tracked_; the robust estimator and what is compared in the initialiser.
  constexpr std::size_t kOfFeature = sizeof(last_.matches[0]) + sizeof(OverlayWatch::Tracked) +
                                     TwoViewRansac::kBytesPerMatch + sizeof(Match) + sizeof(Eigen::Vector2d) +
                                     2 * sizeof(Eigen::Vector3d) + 3 * sizeof(double);
  const std::size_t workspace = features * kOfFeature + OverlayWatch::BytesFor(max_features) +
                                FrameExtractor::BytesFor(max_features) + FlowChain::BytesFor(max_features) +
                                MarkWatch::BytesFor(max_features) +
                                PoseSearch::BytesFor(max_features, config.memory.max_local_points) +
                                PoseRecovery::BytesFor(max_features, config.memory.max_local_points);
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
  ForgetLastFrame();
}

FrameResult Tracker::SkipDamaged(std::uint32_t frame_index, TimePoint timestamp) {
  FrameResult result;
  result.frame_index = frame_index;
  result.timestamp = timestamp;
  result.state = state() == TrackingState::kInitialising ? TrackingState::kInitialising : TrackingState::kLost;
  result.reason = TrackingReason::kDamagedFrame;
  // It shows nothing of what the frame before it did.
  marks_.Clear();
  current_.frame_index = frame_index;
  return result;
}

FrameResult Tracker::Track(const Frame& frame, TimePoint deadline) {
  FrameResult result;
  result.frame_index = frame.index;
  result.timestamp = frame.timestamp;
  MeasurePeriod(frame);
  scene_.Observe(frame.image, frame.timestamp);
  budget_.SetFramePeriod(period_);
  budget_.BeginFrame(deadline, state() == TrackingState::kTracking, NeedsAllFeatures());
  current_.frame_index = frame.index;
  current_.timestamp = frame.timestamp;
  current_.features.set = FeatureSetHandle{};
  current_.features.num = current_.features.num_followed = 0;
  is_set_given_ = false;
  marks_.Clear();
  const bool may_measure = lane_.Drain(budget_.wait_deadline());
  switch (may_measure ? Measure(frame, &result) : Outcome::kNoTime) {
    case Outcome::kPose: AnswerWithPose(&result); break;
    case Outcome::kNoPose:
      if (IsViewOfNewMap(result.reason)) {
        KeepFoundingFrame(result.reason);
      } else {
        ForgetLastFrame();
        DropFrame();
      }
      break;
    case Outcome::kNoTime:
      budget_.GaveUp();
      AnswerWithoutMeasurement(&result);
      DropFrame();
      break;
  }
  result.state = state();
  // What a request under way refers to is still in use.
  if (!lane_.has_pending()) link_.version_done.store(local_map().version, std::memory_order_release);
  budget_.EndFrame();
  result.rung = budget_.rung();
  result.times = budget_.times();
  TellMapper(result, frame.image);
  return result;
}

void Tracker::TellMapper(const FrameResult& result, const ImageView& image) {
  AnsweredFrame answered;
  answered.frame_index = result.frame_index;
  answered.timestamp = result.timestamp;
  answered.map_epoch = result.map_epoch;
  if (result.state == TrackingState::kTracking && result.reason != TrackingReason::kPredicted) {
    answered.reference_keyframe = result.reference_keyframe;
    answered.cam_from_reference = result.cam_from_reference;
    answered.reference_scale = result.reference_scale;
    if (!scene_.has_mask()) answered.surround = DarkSurround(image);
  }
  link_.Answer(answered);
}

// From the last two frames that came. What lasts a time lasts so many frames at the rate of now.
void Tracker::MeasurePeriod(const Frame& frame) {
  if (last_arrival_ && frame.index > last_arrival_->frame_index && frame.timestamp > last_arrival_->timestamp) {
    period_ = (frame.timestamp - last_arrival_->timestamp) / (frame.index - last_arrival_->frame_index);
  }
  last_arrival_ = {frame.index, frame.timestamp};
}

int Tracker::FramesWithin(double time_ms) const {
  return static_cast<int>(std::lround(time_ms / std::max(ToMilliseconds(period_), 1e-3)));
}

// Frames. The slowest source has a course, too.
int Tracker::MaxVelocityAge() const { return std::max(1, FramesWithin(kMaxVelocityMs)); }

// Lost, or nearly so: a young map was made of all features, and few would not find it again.
bool Tracker::NeedsAllFeatures() const {
  const bool is_thin = static_cast<int>(last_.matches.size()) < kThinFactor * config_.tracking.min_inliers;
  return state() == TrackingState::kLost || (state() == TrackingState::kTracking && is_thin);
}

// The newest snapshot, and what the mapper has told up to it.
void Tracker::HearMapper() {
  link_.snapshots.Refresh();
  for (const VersionedReply* next = link_.replies.Front(); next != nullptr; next = link_.replies.Front()) {
    if (next->version > local_map().version) return;
    if (const auto* reframing = std::get_if<Reframing>(&next->reply)) {
      ++heard_.num_reframings;
      if (overlay_map_ == reframing->old_map_id) overlay_map_ = kNoId;
      chain_.Hear(*reframing);
      sight_.Hear(*reframing);
      marks_.Hear(*reframing);
    }
    if (std::holds_alternative<FrameFound>(next->reply)) ++heard_.num_found;
    Hear(next->reply, &state_);
    link_.replies.Pop();
  }
}

Tracker::Outcome Tracker::Measure(const Frame& frame, FrameResult* result) {
  HearMapper();
  search_.Begin();
  if (MayFoundMap()) extractor_.ForgetLast();
  const bool is_extracted = extractor_.Extract(frame.image);
  result->num_features = current_.features.num;
  if (!is_extracted && lane_.has_pending()) return Outcome::kNoTime;
  if (!is_extracted || current_.features.num < kMinFeatures) {
    SetLost();
    result->reason = is_extracted ? TrackingReason::kFewFeatures : TrackingReason::kDamagedFrame;
    return Outcome::kNoPose;
  }
  return state() == TrackingState::kTracking ? TrackMap(result) : FindPose(result);
}

// The frame may become a view of a new map. One that goes on from the second view of a map does not.
bool Tracker::MayFoundMap() const {
  const Lost* lost = std::get_if<Lost>(&state_);
  return lost != nullptr && (!lost->start || lost->start->is_found);
}

// Tracking: guided search, and brute force where it finds nothing or few points hold what it has found.
Tracker::Outcome Tracker::TrackMap(FrameResult* result) {
  Tracking& tracking = std::get<Tracking>(state_);
  result->reason = SearchGuided(tracking, result);
  if (search_.has_no_time()) return Outcome::kNoTime;
  bool has_pose = result->reason == TrackingReason::kTracked;
  const std::vector<PointMatch>& matches = search_.estimate().matches;
  const bool is_questioned = static_cast<int>(matches.size()) < kQuestionedFactor * config_.tracking.min_inliers;
  if (config_.tracking.brute_force_recovery && (!has_pose || is_questioned) && budget_.MayRecover(false)) {
    const PoseRecovery::Verdict verdict = recovery_.Question(has_pose);
    result->search = recovery_.outcome();
    if (verdict == PoseRecovery::Verdict::kNone && has_pose) result->reason = TrackingReason::kWeakEvidence;
    if (verdict == PoseRecovery::Verdict::kRecovered) result->reason = TrackingReason::kRecovered;
    if (verdict == PoseRecovery::Verdict::kRecovered || verdict == PoseRecovery::Verdict::kBetter) {
      result->num_matches = static_cast<int>(matches.size());
    }
    has_pose = verdict != PoseRecovery::Verdict::kNone;
  }
  const bool is_denied =
      has_pose &&
      IsDeniedByFlow(tracking.course.map_id, tracking.has_last_frame && result->reason == TrackingReason::kTracked);
  if (is_denied) result->reason = TrackingReason::kDeniedByFlow;
  if (has_pose && !is_denied) return Outcome::kPose;
  if (lane_.has_pending()) return Outcome::kNoTime;
  SetLost();
  return Outcome::kNoPose;
}

// A pose that was chosen without a prediction needs the flow not to deny it. One that was tracked has a witness of its
// own.
bool Tracker::IsDeniedByFlow(MapId map_id, bool is_tracked) const {
  if (is_tracked && IsHeldByMap()) return false;
  const FlowChain::Witness witness = chain_.Judge(map_id, search_.estimate().cam_from_map, current_.timestamp);
  return is_tracked ? witness.DeniesTracked(static_cast<int>(search_.estimate().matches.size())) : witness.denies;
}

// kTracked, or why the estimate is not to be believed.
TrackingReason Tracker::SearchGuided(const Tracking& tracking, FrameResult* result) {
  const SE3 predicted = Predict(tracking);
  const bool has_seeds = tracking.has_last_frame
                             ? search_.SearchAroundPrediction(predicted, tracking.course.cam_from_map)
                             : search_.SearchWithoutLastFrame(predicted);
  if (!has_seeds) return TrackingReason::kFewMatches;
  search_.KeepInliers();
  const bool has_pose = search_.FitLocalMap(0.0);
  const std::vector<PointMatch>& matches = search_.estimate().matches;
  result->num_matches = static_cast<int>(matches.size());
  search_.KeepInliers();
  if (!has_pose) return TrackingReason::kFewInliers;
  if (search_.IsSuddenlyThin() && budget_.CanAfford(Stage::kLocalMap)) search_.LookAround();
  if (static_cast<int>(matches.size()) < config_.tracking.min_inliers) return TrackingReason::kFewInliers;
  if (!search_.IsTrackedPoseEvident(tracking.is_confirmed)) return TrackingReason::kWeakEvidence;
  return IsPlausibleMotion(predicted) ? TrackingReason::kTracked : TrackingReason::kInconsistentMotion;
}

bool Tracker::IsPlausibleMotion(const SE3& predicted) const {
  const PoseEstimate& estimate = search_.estimate();
  const double jump = (estimate.cam_from_map.InverseTranslation() - predicted.InverseTranslation()).norm();
  return jump <= config_.tracking.max_jump_depth_ratio * estimate.median_depth &&
         RotationAngle(estimate.cam_from_map.rotation, predicted.rotation) <= config_.tracking.max_jump_deg * kDegree;
}

// Where the scope should be now, from its last measured pose and velocity.
SE3 Tracker::Predict(const Tracking& tracking) const {
  SE3 predicted = tracking.course.cam_from_map;
  if (!tracking.velocity) return predicted;
  const int gap = static_cast<int>(current_.frame_index - tracking.course.frame_index);
  for (int i = 0; i < std::min(gap, MaxVelocityAge()); ++i) predicted = *tracking.velocity * predicted;
  return predicted;
}

// No pose so far: what the mapper has answered, brute force against the last window, a new map.
Tracker::Outcome Tracker::FindPose(FrameResult* result) {
  if (std::holds_alternative<AwaitingMap>(state_)) {
    result->reason = TrackingReason::kAwaitingMap;
    return Outcome::kNoPose;
  }
  if (const std::optional<Start> start = std::get<Lost>(state_).start) {
    const Outcome outcome = TryStart(*start, result);
    // The scope has left what was found: nothing is known yet. A new map has no other place to look for.
    if (outcome != Outcome::kNoPose || !start->is_found) return outcome;
  }
  Lost& lost = std::get<Lost>(state_);
  // While the mapper looks for a frame of ours its answer may change the map: then that is what counts.
  const bool may_recover = config_.tracking.brute_force_recovery && lost.course && !lost.is_asking;
  if (may_recover && budget_.MayRecover(true)) {
    const bool is_recovered = recovery_.Recover(true);
    result->search = recovery_.outcome();
    if (is_recovered && !IsDeniedByFlow(local_map().map_id, false)) {
      initialiser_.Reset();
      state_ = Regain(lost, local_map().map_id);
      result->reason = TrackingReason::kRelocalised;
      result->num_matches = static_cast<int>(search_.estimate().matches.size());
      return Outcome::kPose;
    }
    if (is_recovered) result->search = SearchOutcome::kDeniedByFlow;
  }
  return lane_.has_pending() ? Outcome::kNoTime : BeginMap(&lost, result);
}

Tracker::Outcome Tracker::TryStart(const Start& start, FrameResult* result) {
  ForgetLastFrame();
  const TrackerState before = state_;
  state_ = GoOnFrom(start, current_.timestamp);
  const Outcome outcome = TrackMap(result);
  // Nothing was measured in that map yet. The next frame tries it.
  if (outcome == Outcome::kNoTime) state_ = before;
  if (!start.is_found || outcome != Outcome::kPose) return outcome;
  if (!search_.HasEstablishedWitnesses()) {
    SetLost();
    result->reason = TrackingReason::kWeakEvidence;
    return Outcome::kNoPose;
  }
  initialiser_.Reset();
  result->reason = TrackingReason::kRelocalised;
  return outcome;
}

// Asks for the frame's place and tries to found a map with it; whichever answer comes first counts.
Tracker::Outcome Tracker::BeginMap(Lost* lost, FrameResult* result) {
  if (!lost->is_asking) lost->is_asking = proposer_.AskForPlace();
  if (!initialiser_.has_reference()) {
    result->reason = TrackingReason::kFirstView;
  } else if (!budget_.MayInitialise()) {
    result->reason = TrackingReason::kNoTime;
  } else {
    const FrameBudget::Timer timer(budget_, Stage::kInitialise);
    result->reason = initialiser_.Try(current_, budget_);
    budget_.EndInitialising(result->reason == TrackingReason::kNoTime);
    if (lane_.has_pending()) return Outcome::kNoTime;
    result->num_matches = initialiser_.num_matches();
    result->num_inliers = initialiser_.num_inliers();
  }
  if (result->reason == TrackingReason::kMapProposed) {
    ForgetLastFrame();
    for (const FoundingPair& pair : initialiser_.pairs()) last_.matches.emplace_back(pair.feature, MapPointHandle{});
    const std::optional<AwaitingMap> awaiting = proposer_.ProposeMap(*lost, &initialiser_);
    is_set_given_ = awaiting.has_value();
    if (awaiting) state_ = *awaiting;
    return Outcome::kNoPose;
  }
  // A view that was not compared is kept, too: a later one spans it.
  const bool is_compared = result->reason != TrackingReason::kFirstView && result->reason != TrackingReason::kNoTime;
  if (is_compared && initialiser_.is_worn_out()) initialiser_.RenewReference();
  initialiser_.Keep(current_);
  is_set_given_ = true;
  return Outcome::kNoPose;
}

void Tracker::AnswerWithPose(FrameResult* result) {
  Tracking& tracking = std::get<Tracking>(state_);
  const PoseEstimate& estimate = search_.estimate();
  const LocalKeyframe& reference = local_map().keyframes[search_.NearestKeyframe()];
  tracking.reference = reference.id;
  result->map_id = tracking.course.map_id;
  result->map_epoch = heard_.num_reframings;
  result->cam_from_map = estimate.cam_from_map;
  result->reference_keyframe = reference.id;
  result->cam_from_reference = estimate.cam_from_map * reference.cam_from_map.Inverse();
  result->reference_scale = reference.scale;
  result->num_inliers = static_cast<int>(estimate.matches.size());
  result->num_expected = estimate.num_expected;
  result->num_established = estimate.num_established;
  marks_.Look(local_map(), estimate);
  // A pose that was chosen says nothing of how well the map is seen before the next frame confirms it.
  if (result->reason == TrackingReason::kTracked) {
    const double share = SearchedShare(config_.scheduler, budget_.has_fewer_points(), current_.features.is_reduced);
    sight_.Note(tracking.course.map_id, result->num_inliers, share, current_.timestamp);
  }
  MeasureNoise(tracking);
  WatchOverlay(tracking.course.map_id);
  ConsiderKeyframe(reference, &tracking, result);
  tracking.is_confirmed = result->reason == TrackingReason::kTracked;
  KeepFrame(&tracking);
  AnchorChain(*result);
}

// The scope keeps its course, and the map its shape.
void Tracker::AnswerWithoutMeasurement(FrameResult* result) {
  budget_.StepDown(Rung::kPredicted);
  result->reason = TrackingReason::kNoTime;
  Tracking* tracking = std::get_if<Tracking>(&state_);
  if (tracking == nullptr) return;
  const auto& keyframes = local_map().keyframes;
  // Frames that the source dropped count, too. Where frames were numbered anew, the difference is too large.
  const std::uint32_t gap = current_.frame_index - tracking->course.frame_index;
  const auto max_gap = static_cast<std::uint32_t>(FramesWithin(config_.scheduler.max_predicted_ms));
  if (gap > max_gap || keyframes.empty()) {
    SetLost();
    return;
  }
  const auto* reference = std::find_if(keyframes.begin(), keyframes.end(),
                                       [&](const LocalKeyframe& k) { return k.id == tracking->reference; });
  if (reference == keyframes.end()) reference = keyframes.begin();
  const SE3 predicted = Predict(*tracking);
  marks_.LookAhead(local_map(), predicted);
  result->reason = TrackingReason::kPredicted;
  result->map_id = tracking->course.map_id;
  result->map_epoch = heard_.num_reframings;
  result->cam_from_map = predicted;
  result->reference_keyframe = reference->id;
  result->cam_from_reference = predicted * reference->cam_from_map.Inverse();
  result->reference_scale = reference->scale;
}

// What the points of the last frame leave at the pose that was found.
void Tracker::MeasureNoise(const Tracking& tracking) {
  for (const PointMatch& seed : search_.seeds()) {
    Eigen::Vector2d pixel;
    const Eigen::Vector3d& position = local_map().points[seed.point_idx].position;
    if (!camera_.Project(search_.estimate().cam_from_map * position, &pixel)) continue;
    noise_meter_.Add((pixel - current_.features.pixel(seed.feature_idx)).norm(),
                     current_.features.keypoints[seed.feature_idx].scale_px);
  }
  // The time without a pose does not age what was measured before: the video is the same.
  noise_meter_.EndFrame(tracking.velocity ? ToSeconds(current_.timestamp - last_timestamp_) : 0.0);
  last_timestamp_ = current_.timestamp;
}

// What stands still in front of the scene, by an earlier frame of the same map.
void Tracker::WatchOverlay(MapId map_id) {
  if (!overlay_.is_due(current_.timestamp)) return;
  if (overlay_.has_frame() && overlay_map_ == map_id) {
    tracked_.clear();
    for (const PointMatch& match : search_.estimate().matches) {
      Eigen::Vector2d pixel;
      if (!camera_.Project(overlay_pose_ * local_map().points[match.point_idx].position, &pixel)) continue;
      tracked_.push_back({match.feature_idx, pixel.cast<float>()});
    }
    overlay_.Compare(current_.features, tracked_, current_.timestamp);
  }
  overlay_.KeepFrame(current_.features, current_.timestamp);
  overlay_pose_ = search_.estimate().cam_from_map;
  overlay_map_ = map_id;
}

void Tracker::ConsiderKeyframe(const LocalKeyframe& reference, Tracking* tracking, FrameResult* result) {
  // A pose that was found without a prediction waits for the next frame to confirm it.
  if (result->reason != TrackingReason::kTracked) return;
  if (!proposer_.IsKeyframe(*tracking, search_.estimate(), local_map(), reference, budget_.has_fewer_points())) return;
  result->is_keyframe = proposer_.ProposeKeyframe(search_.estimate(), local_map(), tracking);
}

// The current frame becomes the last one. Its feature set stays ours until the next one does, whatever the mapper makes
// of the keyframe that it may be.
void Tracker::KeepFrame(Tracking* tracking) {
  ForgetLastFrame();
  const PoseEstimate& estimate = search_.estimate();
  Course& course = tracking->course;
  const int gap = static_cast<int>(current_.frame_index - course.frame_index);
  if (gap > 0) {
    tracking->velocity.reset();
    const SE3 moved = estimate.cam_from_map * course.cam_from_map.Inverse();
    if (gap <= MaxVelocityAge()) tracking->velocity = SE3::Exp(moved.Log() / gap);
  }
  course.cam_from_map = estimate.cam_from_map;
  course.frame_index = current_.frame_index;
  std::swap(last_.features, current_.features);
  extractor_.KeepLast();
  owns_last_set_ = true;
  for (const PointMatch& match : estimate.matches) {
    last_.matches.emplace_back(match.feature_idx, local_map().points[match.point_idx].handle);
  }
  tracking->has_last_frame = true;
}

// It was proposed as one, or the mapper is at it; and it shows something.
bool Tracker::IsViewOfNewMap(TrackingReason reason) const {
  return std::holds_alternative<AwaitingMap>(state_) &&
         (reason == TrackingReason::kMapProposed || reason == TrackingReason::kAwaitingMap);
}

// While the mapper makes a map, what its second view shows is followed: the detector alone finds too little of a young
// map again. last_ has the features of the founding for matches, without points.
void Tracker::KeepFoundingFrame(TrackingReason reason) {
  if (reason != TrackingReason::kMapProposed) ForgetLastFrame();
  std::swap(last_.features, current_.features);
  owns_last_set_ = !is_set_given_;
  extractor_.KeepLast();
}

std::size_t Tracker::MatchedPixels(std::span<Eigen::Vector2f> to) const {
  const Tracking* tracking = std::get_if<Tracking>(&state_);
  // A pose that was predicted leaves the last frame that was measured as it is.
  if (tracking == nullptr || !tracking->has_last_frame || tracking->course.frame_index != current_.frame_index)
    return 0;
  const std::size_t count = std::min(to.size(), last_.matches.size());
  for (std::size_t i = 0; i < count; ++i) {
    to[i] = last_.features.pixel(last_.matches[i * last_.matches.size() / count].first).cast<float>();
  }
  return count;
}

// As much of the map agrees with the pose as with that of the anchor.
bool Tracker::IsHeldByMap() const {
  const auto num = static_cast<int>(search_.estimate().matches.size());
  return num >= kQuestionedFactor * config_.tracking.min_inliers && num >= kAnchorShare * anchor_inliers_;
}

// The chain begins anew where the map holds the pose, and where it has grown old or has left the map.
void Tracker::AnchorChain(const FrameResult& result) {
  const bool is_bound = chain_.map_id() == result.map_id && chain_.AgeMs(result.timestamp) <= kMaxAnchorMs;
  if (!config_.features.are_followed || result.reason != TrackingReason::kTracked) return;
  if (is_bound && !IsHeldByMap()) return;
  anchor_inliers_ = result.num_inliers;
  chain_.Begin(last_, result.map_id, result.cam_from_map, result.timestamp);
}

void Tracker::ForgetLastFrame() {
  if (owns_last_set_) device_.ReleaseFeatureSet(last_.features.set);
  owns_last_set_ = false;
  last_.matches.clear();
}

void Tracker::DropFrame() {
  if (current_.features.set.is_valid() && !is_set_given_) lane_.ReleaseFeatureSet(current_.features.set);
  current_.features.set = FeatureSetHandle{};
}

void Tracker::SetLost() {
  if (const Tracking* tracking = std::get_if<Tracking>(&state_)) state_ = LostFrom(*tracking);
}

}  // namespace haustra
