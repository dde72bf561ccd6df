#include "engine/merging/merger.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

namespace haustra {
namespace {

// Weight of the edges that hold a loop together, against at most 1 of the others.
constexpr double kJointWeight = 4.0;

bool IsSimilarity(const Sim3& s) {
  return std::isfinite(s.scale) && s.scale > 0.0 && s.rotation.coeffs().allFinite() && s.translation.allFinite();
}

bool IsSame(const SE3& a, const SE3& b) {
  return a.rotation.coeffs() == b.rotation.coeffs() && a.translation == b.translation;
}

// Takes points at a keyframe from where they were to where they are.
Sim3 NowFromThen(const SE3& cam_from_now, double scale_now, const KeyframeAnchor& then) {
  // x_camera = cam_from_then * point_then in the old unit, and cam_from_now * point_now in the new one, `growth` times
  // as large.
  const double growth = scale_now / then.scale;
  const Sim3 camera_from_now =
      Sim3(1.0 / growth, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()) * Sim3(cam_from_now);
  return camera_from_now.Inverse() * Sim3(then.cam_from_map);
}

bool Contains(std::span<const KeyframeHandle> list, KeyframeHandle keyframe) {
  return std::find(list.begin(), list.end(), keyframe) != list.end();
}

int NumShared(std::span<const Covisible> list, KeyframeHandle keyframe) {
  const auto found = std::find_if(list.begin(), list.end(),
                                  [&](const Covisible& covisible) { return covisible.keyframe == keyframe; });
  return found == list.end() ? 0 : found->num_shared;
}

bool HasBothKeyframes(const MergePlan& plan, const Atlas& atlas) {
  return atlas.GetKeyframe(plan.keyframe_a) != nullptr && atlas.GetKeyframe(plan.keyframe_b) != nullptr;
}

// The plan's similarity between the maps as they are now.
Sim3 UpToDate(const MergePlan& plan, const Atlas& atlas) {
  const SE3 pose_a = atlas.keyframe(plan.keyframe_a).cam_from_map,
            pose_b = atlas.keyframe(plan.keyframe_b).cam_from_map;
  const double scale_a = atlas.KeyframeScale(plan.keyframe_a), scale_b = atlas.KeyframeScale(plan.keyframe_b);
  const bool has_moved = !IsSame(pose_a, plan.anchor_a.cam_from_map) || !IsSame(pose_b, plan.anchor_b.cam_from_map) ||
                         scale_a != plan.anchor_a.scale || scale_b != plan.anchor_b.scale;
  // Without rounding where nothing has moved.
  if (!has_moved) return plan.b_from_a;
  return NowFromThen(pose_b, scale_b, plan.anchor_b) * plan.b_from_a *
         NowFromThen(pose_a, scale_a, plan.anchor_a).Inverse();
}

}  // namespace

Merger::Merger(const EngineConfig& config, const MergingConfig& options, const NoiseModel& noise,
               const CameraModel& camera, VisionDevice& device, SchurBundleAdjuster& adjuster)
    : config_(config),
      options_(options),
      fuser_(config, noise, camera, device),
      weld_(config, options, noise, camera, adjuster),
      graph_(options, config.memory.max_keyframes),
      collector_(config.memory.max_map_points) {}

Status Merger::Begin(const MergePlan& plan, const Atlas& atlas) {
  stage_ = Stage::kDone;
  outcome_ = MergeOutcome{};
  const Keyframe* a = atlas.GetKeyframe(plan.keyframe_a);
  const Keyframe* b = atlas.GetKeyframe(plan.keyframe_b);
  if (a == nullptr || b == nullptr || plan.keyframe_a == plan.keyframe_b) {
    return FailedPrecondition("merge: a keyframe of the plan is gone");
  }
  if (!IsSimilarity(plan.b_from_a)) {
    return InvalidArgument("merge: scale " + std::to_string(plan.b_from_a.scale) + " is not that of a similarity");
  }
  plan_ = plan;
  outcome_.is_loop = a->map == b->map;
  const auto standing = [&](MapHandle map) {
    return std::pair(atlas.map(map).keyframes.size(), std::numeric_limits<MapId>::max() - atlas.map(map).id);
  };
  a_stays_ = standing(a->map) > standing(b->map);
  map_ = a_stays_ ? b->map : a->map;
  tracked_map_ = a->map;
  first_new_ = atlas.num_keyframe_ids();
  is_stopped_ = has_weld_ = false;
  const int min_shared = config_.mapping.min_shared_points;
  CollectGroup(atlas, plan.keyframe_a, options_.window_keyframes, min_shared, &covisible_, &window_a_);
  CollectGroup(atlas, plan.keyframe_b, options_.window_keyframes, min_shared, &covisible_, &window_b_);
  if (outcome_.is_loop) PartEnds(atlas);
  std::vector<KeyframeHandle> singles = a_stays_ ? window_b_ : window_a_;
  if (outcome_.is_loop) singles.insert(singles.end(), window_b_.begin(), window_b_.end());
  graph_.Begin(atlas, atlas.map(map_).keyframes, singles);
  stage_ = Stage::kCapture;
  return Status::Ok();
}

Result<Merger::Progress> Merger::Step(const JoinLimits& limits, KeyframeHandle tracked, Atlas* atlas) {
  const Keyframe* before = atlas->GetKeyframe(tracked);
  outcome_.is_reframed = false;
  if (before == nullptr || before->map != tracked_map_) {
    stage_ = Stage::kDone;
    if (outcome_.has_moved) return Progress::kDone;
    return FailedPrecondition("merge: tracking is not in the plan's map");
  }
  const KeyframeAnchor anchor{before->cam_from_map, atlas->KeyframeScale(tracked)};
  outcome_.reframing.old_map_id = atlas->map(before->map).id;
  DropGone(*atlas);
  const auto is_move = [this] { return stage_ == Stage::kMove || stage_ == Stage::kPlace; };
  while (stage_ != Stage::kDone) {
    const Status status = DoNext(limits, atlas);
    if (!status.ok()) {
      stage_ = Stage::kDone;
      return status;
    }
    // A move has a slice of its own.
    if (limits.slice_end != kNoDeadline && (is_move() || outcome_.is_reframed)) break;
    if (is_stopped_ || limits.is_slice_over()) break;
  }
  if (outcome_.is_reframed) {
    const Keyframe& moved = atlas->keyframe(tracked);
    outcome_.map = tracked_map_ = moved.map;
    outcome_.map_id = atlas->map(moved.map).id;
    outcome_.reframing.new_map_id = outcome_.map_id;
    outcome_.reframing.new_from_old = NowFromThen(moved.cam_from_map, atlas->KeyframeScale(tracked), anchor);
  }
  return stage_ == Stage::kDone ? Progress::kDone : Progress::kMore;
}

// One piece of work.
Status Merger::DoNext(const JoinLimits& limits, Atlas* atlas) {
  is_stopped_ = false;
  if (!outcome_.has_moved && stage_ != Stage::kSolve && limits.is_over()) {
    return Status(StatusCode::kDeadlineExceeded, "join: no time was left to prepare it");
  }
  switch (stage_) {
    case Stage::kCapture:
      if (graph_.CaptureNext(*atlas)) break;
      if (!outcome_.is_loop) {
        stage_ = Stage::kMove;
        break;
      }
      HAUSTRA_TRY(SetUpLoop(*atlas));
      stage_ = Stage::kSolve;
      break;
    case Stage::kSolve: HAUSTRA_TRY(Solve(limits)); break;
    case Stage::kMove:
      if (outcome_.is_loop) {
        graph_.Adopt(*atlas, map_, true);
        graph_.Apply({}, atlas);
      } else {
        if (!HasBothKeyframes(plan_, *atlas)) return FailedPrecondition("merge: a keyframe of the plan is gone");
        MoveMap(atlas);
      }
      outcome_.has_moved = outcome_.is_reframed = true;
      stage_ = Stage::kFuse;
      break;
    case Stage::kFuse:
      FusePlan(atlas);
      BeginSearch();
      stage_ = Stage::kSearch;
      break;
    case Stage::kSearch:
      if (searches_.empty() || limits.is_over()) {
        stage_ = Stage::kWeld;
      } else {
        SearchNext(atlas);
      }
      break;
    case Stage::kWeld: WeldSeam(limits, *atlas); break;
    case Stage::kPlace:
      PlaceSeam(atlas);
      outcome_.is_reframed = true;
      stage_ = Stage::kDone;
      break;
    case Stage::kDone: break;
  }
  return Status::Ok();
}

// The ends of a loop may share some points. Each keyframe belongs to the end with which it shares more: one that stood
// in both would hold the end that is to move where it is.
void Merger::PartEnds(const Atlas& atlas) {
  std::vector<Covisible> near_a, near_b;
  atlas.FindCovisible(plan_.keyframe_a, 1, &near_a);
  atlas.FindCovisible(plan_.keyframe_b, 1, &near_b);
  const auto is_at_a = [&](KeyframeHandle keyframe) {
    if (keyframe == plan_.keyframe_a || keyframe == plan_.keyframe_b) return keyframe == plan_.keyframe_a;
    return NumShared(near_a, keyframe) > NumShared(near_b, keyframe);
  };
  std::erase_if(window_a_, [&](KeyframeHandle keyframe) { return !is_at_a(keyframe); });
  std::erase_if(window_b_, is_at_a);
}

// The graph of a loop, whose ends are known.
Status Merger::SetUpLoop(const Atlas& atlas) {
  if (!HasBothKeyframes(plan_, atlas)) return FailedPrecondition("loop: a keyframe of the plan is gone");
  const Sim3 correction = UpToDate(plan_, atlas);
  graph_.TakePoses(atlas, Sim3{});
  for (const KeyframeHandle handle : window_a_) graph_.SetCorrection(handle, correction, false);
  for (const KeyframeHandle handle : window_b_) graph_.SetCorrection(handle, Sim3{}, true);
  graph_.AddJoint(plan_.keyframe_b, plan_.keyframe_a, kJointWeight);
  return Status::Ok();
}

Status Merger::Solve(const JoinLimits& limits) {
  outcome_.num_graph_nodes = graph_.num_nodes();
  outcome_.num_graph_edges = graph_.num_edges();
  JoinStopper stopper(limits);
  const Result<PoseGraphSummary> summary = graph_.Solve(stopper.function());
  if (summary.ok()) {
    outcome_.graph_iterations = summary->iterations;
    outcome_.graph_state = summary->state;
  }
  if (summary.ok() && stopper.has_stopped() && !limits.is_last()) {
    is_stopped_ = true;
    return Status::Ok();
  }
  // Of a merge, unless it converges the guess stands: everything moves with the new keyframe.
  stage_ = outcome_.is_loop ? Stage::kMove : Stage::kPlace;
  if (!outcome_.is_loop) return Status::Ok();
  if (!summary.ok()) return summary.status();
  // The loop stays open: half a correction would tear the map.
  if (summary->state == SolveState::kPartial) {
    return Status(StatusCode::kDeadlineExceeded, "loop: the pose graph was stopped");
  }
  if (summary->state == SolveState::kNone) return Internal("loop: the pose graph has no solution");
  return Status::Ok();
}

void Merger::MoveMap(Atlas* atlas) {
  const MapHandle map_a = atlas->keyframe(plan_.keyframe_a).map;
  const MapHandle map_b = atlas->keyframe(plan_.keyframe_b).map;
  const MapHandle staying = a_stays_ ? map_a : map_b;
  const MapHandle moving = a_stays_ ? map_b : map_a;
  outcome_.absorbed = moving;
  outcome_.absorbed_map_id = atlas->map(moving).id;
  plan_.b_from_a = UpToDate(plan_, *atlas);
  const Sim3 new_from_old = a_stays_ ? plan_.b_from_a.Inverse() : plan_.b_from_a;
  atlas->TransformMap(moving, new_from_old);
  // Covisibility before fusion: the graph holds the moving map together, the weld ties it to the other one.
  graph_.TakePoses(*atlas, new_from_old);
  graph_.Adopt(*atlas, moving, true);
  atlas->AbsorbMap(staying, moving);
  map_ = staying;
}

// What was proven to be one point.
void Merger::FusePlan(Atlas* atlas) {
  for (const CommonPoint& common : plan_.points) {
    const MapPoint* a = atlas->GetPoint(common.point_a);
    const MapPoint* b = atlas->GetPoint(common.point_b);
    // Points may have gone since the plan was made, or have become one.
    if (a == nullptr || b == nullptr || common.point_a == common.point_b) continue;
    const bool keep_b = b->observations.size() >= a->observations.size();
    atlas->FusePoints(keep_b ? common.point_a : common.point_b, keep_b ? common.point_b : common.point_a);
    ++outcome_.num_fused;
  }
}

// What is found to be one point by searching each side in the other.
void Merger::BeginSearch() {
  searches_.clear();
  for (const bool is_from_b : {true, false}) {
    bool is_first = true;
    for (const KeyframeHandle into : is_from_b ? window_a_ : window_b_) {
      searches_.push_back({is_from_b, is_first, into});
      is_first = false;
    }
  }
  std::reverse(searches_.begin(), searches_.end());
}

void Merger::SearchNext(Atlas* atlas) {
  const Search search = searches_.back();
  searches_.pop_back();
  if (search.is_first) collector_.Collect(*atlas, search.is_from_b ? window_b_ : window_a_, &points_);
  if (atlas->GetKeyframe(search.into) == nullptr) return;
  outcome_.num_fused += fuser_.SearchInto(search.into, points_, atlas);
}

void Merger::WeldSeam(const JoinLimits& limits, const Atlas& atlas) {
  if (!has_weld_) {
    if (window_a_.empty() || window_b_.empty()) {
      stage_ = Stage::kDone;  // the seam has been culled meanwhile
      return;
    }
    CopySeam(atlas);
    has_weld_ = true;
    if (limits.is_slice_over()) return;
  }
  JoinStopper stopper(limits);
  weld_.Solve(stopper.function());
  const BundleSummary& summary = weld_.summary();
  outcome_.num_weld_outliers = summary.num_outliers;
  outcome_.weld_iterations = summary.iterations;
  outcome_.weld_initial_cost = summary.initial_cost;
  outcome_.weld_final_cost = summary.final_cost;
  outcome_.weld_state = summary.state;
  if (stopper.has_stopped() && !limits.is_last()) {
    is_stopped_ = true;
    return;
  }
  stage_ = Stage::kPlace;
  if (!outcome_.is_loop) SetUpFollowers(atlas);
}

// The windows, and what came beside them since.
void Merger::CopySeam(const Atlas& atlas) {
  const bool is_a_moving = outcome_.is_loop || !a_stays_;
  std::vector<KeyframeHandle> moving = is_a_moving ? window_a_ : window_b_;
  std::vector<KeyframeHandle> reference = is_a_moving ? window_b_ : window_a_;
  num_welded_old_ = moving.size();
  if (!outcome_.is_loop) graph_.Adopt(atlas, map_, is_a_moving);
  const auto& all = atlas.map(map_).keyframes;
  int num_left = options_.window_keyframes;
  for (auto it = all.rbegin(); it != all.rend() && atlas.keyframe(*it).id >= first_new_ && num_left > 0; ++it) {
    atlas.FindCovisible(*it, config_.mapping.min_shared_points, &covisible_);
    const bool is_at_seam = std::any_of(covisible_.begin(), covisible_.end(), [&](const Covisible& c) {
      return Contains(window_a_, c.keyframe) || Contains(window_b_, c.keyframe);
    });
    if (!is_at_seam) continue;
    (outcome_.is_loop || graph_.Has(*it) ? moving : reference).push_back(*it);
    --num_left;
  }
  first_unwelded_ = atlas.num_keyframe_ids();
  Weld::Sides sides;
  sides.moving = moving;
  sides.reference = reference;
  // What is new is where tracking took it to be, on either side.
  sides.may_hold = [&](KeyframeHandle handle) {
    return atlas.keyframe(handle).id < first_new_ && (outcome_.is_loop || !graph_.Has(handle));
  };
  weld_.Begin(sides, atlas);
  outcome_.num_weld_keyframes = static_cast<int>(weld_.keyframes().size());
  outcome_.num_weld_points = weld_.num_points();
}

// The weld says where its keyframes are and what happened to their unit; the others go along.
void Merger::SetUpFollowers(const Atlas& atlas) {
  const std::span<const KeyframeHandle> welded = weld_.moving_side().first(num_welded_old_);
  const double growth = weld_.moving_scale();
  graph_.SetAllCorrections(weld_.Correction(0, growth));
  for (std::size_t i = 0; i < welded.size(); ++i) graph_.SetCorrection(welded[i], weld_.Correction(i, growth), true);
  const auto is_follower = [&](KeyframeHandle handle) {
    return atlas.GetKeyframe(handle) != nullptr && !Contains(welded, handle);
  };
  const auto all = graph_.keyframes();
  if (std::any_of(all.begin(), all.end(), is_follower)) stage_ = Stage::kSolve;
}

void Merger::PlaceSeam(Atlas* atlas) {
  weld_.WriteBack(atlas);
  if (outcome_.is_loop) {
    TakeAlong(atlas);
    return;
  }
  for (const KeyframeHandle handle : weld_.moving_side()) {
    const Keyframe* keyframe = atlas->GetKeyframe(handle);
    if (keyframe != nullptr) atlas->CorrectKeyframe(handle, SE3(keyframe->cam_from_map), weld_.moving_scale());
  }
  graph_.Adopt(*atlas, map_, !a_stays_);
  if (outcome_.num_graph_nodes == 0 && !graph_.has_adopted()) return;
  graph_.Apply({[this](KeyframeHandle keyframe) { return weld_.Has(keyframe); },
                [this](MapPointHandle point) { return weld_.Has(point); }},
               atlas);
}

// What has come to a loop's seam since it was copied goes with the keyframe that it shares most points with.
void Merger::TakeAlong(Atlas* atlas) {
  if (weld_.summary().state == SolveState::kNone) return;
  const auto& all = atlas->map(map_).keyframes;
  auto first = all.end();
  while (first != all.begin() && atlas->keyframe(*(first - 1)).id >= first_unwelded_) --first;
  // The oldest first: that keyframe may have come since, too.
  taken_.clear();
  for (auto it = first; it != all.end(); ++it) {
    atlas->FindCovisible(*it, 1, &covisible_);
    if (covisible_.empty()) continue;
    const auto welded = weld_.keyframes();
    const auto kin = std::find(welded.begin(), welded.end(), covisible_.front().keyframe);
    auto kin_idx = static_cast<std::size_t>(kin - welded.begin());
    if (kin == welded.end()) {
      const auto is_kin = [&](const Taken& taken) { return taken.keyframe == covisible_.front().keyframe; };
      const auto taken = std::find_if(taken_.begin(), taken_.end(), is_kin);
      if (taken == taken_.end()) continue;
      kin_idx = taken->kin_idx;
    }
    taken_.push_back({*it, kin_idx});
    const Sim3 correction = weld_.Correction(kin_idx, 1.0);
    Keyframe& keyframe = atlas->keyframe(*it);
    keyframe.cam_from_map = TransformPose(keyframe.cam_from_map, correction);
    for (int i = 0; i < keyframe.features.num; ++i) {
      MapPoint* point = atlas->GetPoint(keyframe.points[i]);
      if (point == nullptr || point->first_keyframe_id != keyframe.id || weld_.Has(keyframe.points[i])) continue;
      point->position = correction * point->position;
      atlas->UpdatePoint(keyframe.points[i]);
    }
  }
}

// Culled since the last slice.
void Merger::DropGone(const Atlas& atlas) {
  const auto is_gone = [&](KeyframeHandle handle) { return atlas.GetKeyframe(handle) == nullptr; };
  std::erase_if(window_a_, is_gone);
  std::erase_if(window_b_, is_gone);
}

}  // namespace haustra
