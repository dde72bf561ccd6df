#include "engine/merging/merger.h"

#include <algorithm>
#include <cmath>
#include <limits>
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
      noise_(noise),
      options_(options),
      fuser_(config, noise, camera, device),
      weld_(config, options, noise, camera, adjuster),
      graph_(options, config.memory.max_keyframes),
      collector_(config.memory.max_map_points) {}

Status Merger::Apply(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline,
                     MergeOutcome* outcome) {
  const Keyframe* a = atlas->GetKeyframe(plan.keyframe_a);
  const Keyframe* b = atlas->GetKeyframe(plan.keyframe_b);
  const Keyframe* tracked = atlas->GetKeyframe(plan.tracked);
  if (a == nullptr || b == nullptr || plan.keyframe_a == plan.keyframe_b) {
    return FailedPrecondition("merge: a keyframe of the plan is gone");
  }
  if (tracked == nullptr || tracked->map != a->map)
    return FailedPrecondition("merge: tracking is not in the plan's map");
  if (!IsSimilarity(plan.b_from_a)) {
    return InvalidArgument("merge: scale " + std::to_string(plan.b_from_a.scale) + " is not that of a similarity");
  }
  MergePlan current = plan;
  current.b_from_a = UpToDate(plan, *atlas);
  *outcome = MergeOutcome{};
  outcome->is_loop = a->map == b->map;
  outcome->reframing.old_map_id = atlas->map(a->map).id;
  const KeyframeAnchor before{tracked->cam_from_map, atlas->KeyframeScale(plan.tracked)};

  const int min_shared = config_.mapping.min_shared_points;
  CollectGroup(*atlas, plan.keyframe_a, options_.window_keyframes, min_shared, &covisible_, &window_a_);
  CollectGroup(*atlas, plan.keyframe_b, options_.window_keyframes, min_shared, &covisible_, &window_b_);
  if (outcome->is_loop) {
    HAUSTRA_TRY(Close(current, atlas, clock, deadline, outcome));
  } else {
    Join(current, atlas, clock, deadline, outcome);
  }

  const Keyframe& moved = atlas->keyframe(plan.tracked);
  outcome->map = moved.map;
  outcome->map_id = atlas->map(moved.map).id;
  outcome->reframing.new_map_id = outcome->map_id;
  outcome->reframing.new_from_old = NowFromThen(moved.cam_from_map, atlas->KeyframeScale(plan.tracked), before);
  return Status::Ok();
}

void Merger::Join(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline, MergeOutcome* outcome) {
  const MapHandle map_a = atlas->keyframe(plan.keyframe_a).map;
  const MapHandle map_b = atlas->keyframe(plan.keyframe_b).map;
  const auto standing = [&](MapHandle map) {
    return std::pair(atlas->map(map).keyframes.size(), std::numeric_limits<MapId>::max() - atlas->map(map).id);
  };
  const bool a_stays = standing(map_a) > standing(map_b);
  const MapHandle staying = a_stays ? map_a : map_b;
  const MapHandle moving = a_stays ? map_b : map_a;
  outcome->absorbed = moving;
  outcome->absorbed_map_id = atlas->map(moving).id;
  const auto& moving_keyframes = atlas->map(moving).keyframes;
  moved_.assign(moving_keyframes.begin(), moving_keyframes.end());
  const std::vector<KeyframeHandle>& moving_window = a_stays ? window_b_ : window_a_;
  atlas->TransformMap(moving, a_stays ? plan.b_from_a.Inverse() : plan.b_from_a);
  // Covisibility before fusion: the graph holds the moving map together, the weld ties it to the other one.
  graph_.Capture(*atlas, moved_, moving_window);
  atlas->AbsorbMap(staying, moving);
  Fuse(plan, atlas, outcome);

  Weld::Sides sides;
  sides.moving = moving_window;
  sides.reference = a_stays ? window_a_ : window_b_;
  sides.may_hold = [this](KeyframeHandle handle) {
    return std::find(moved_.begin(), moved_.end(), handle) == moved_.end();
  };
  std::vector<SE3> poses_before;
  for (const KeyframeHandle handle : moving_window) poses_before.push_back(atlas->keyframe(handle).cam_from_map);
  WeldSeam(sides, atlas, clock, deadline, outcome);

  // The weld says where its keyframes are and what happened to their unit; the others go along.
  const double growth = weld_.moving_scale();
  const auto correction_of = [&](std::size_t i) {
    const Sim3 old(poses_before[i]);
    const Sim3 unit(1.0 / growth, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
    return (unit * Sim3(atlas->keyframe(moving_window[i]).cam_from_map)).Inverse() * old;
  };
  const Sim3 guess = correction_of(0);
  for (const KeyframeHandle handle : moved_) graph_.SetCorrection(handle, guess, false);
  for (std::size_t i = 0; i < moving_window.size(); ++i) {
    graph_.SetCorrection(moving_window[i], correction_of(i), true);
    const SE3 welded = atlas->keyframe(moving_window[i]).cam_from_map;
    atlas->CorrectKeyframe(moving_window[i], welded, growth);
  }
  if (moved_.size() == moving_window.size()) return;
  outcome->num_graph_nodes = graph_.num_nodes();
  outcome->num_graph_edges = graph_.num_edges();
  // Unless it converges the guess stands: everything moves with the new keyframe.
  const Result<PoseGraphSummary> summary = graph_.Solve(clock, deadline);
  if (summary.ok()) {
    outcome->graph_iterations = summary->iterations;
    outcome->graph_state = summary->state;
  }
  graph_.Apply(atlas);
}

Status Merger::Close(const MergePlan& plan, Atlas* atlas, const Clock* clock, TimePoint deadline,
                     MergeOutcome* outcome) {
  const auto& all = atlas->map(atlas->keyframe(plan.keyframe_a).map).keyframes;
  moved_.assign(all.begin(), all.end());
  std::vector<KeyframeHandle> singles = window_a_;
  singles.insert(singles.end(), window_b_.begin(), window_b_.end());
  graph_.Capture(*atlas, moved_, singles);
  for (const KeyframeHandle handle : window_a_) graph_.SetCorrection(handle, plan.b_from_a, false);
  // A keyframe in both windows stands where the map stood.
  for (const KeyframeHandle handle : window_b_) graph_.SetCorrection(handle, Sim3{}, true);
  graph_.AddJoint(plan.keyframe_b, plan.keyframe_a, kJointWeight);
  outcome->num_graph_nodes = graph_.num_nodes();
  outcome->num_graph_edges = graph_.num_edges();
  const Result<PoseGraphSummary> summary = graph_.Solve(clock, deadline);
  if (!summary.ok()) return summary.status();
  outcome->graph_iterations = summary->iterations;
  outcome->graph_state = summary->state;
  // The loop stays open: half a correction would tear the map.
  if (summary->state == SolveState::kPartial) {
    return Status(StatusCode::kDeadlineExceeded, "loop: the pose graph was stopped");
  }
  if (summary->state == SolveState::kNone) return Internal("loop: the pose graph has no solution");
  graph_.Apply(atlas);
  Fuse(plan, atlas, outcome);
  Weld::Sides sides;
  sides.moving = window_a_;
  sides.reference = window_b_;
  sides.may_hold = [](KeyframeHandle) { return true; };
  WeldSeam(sides, atlas, clock, deadline, outcome);
  return Status::Ok();
}

// What was proven to be one point, then what is found to be one by searching each side in the other.
void Merger::Fuse(const MergePlan& plan, Atlas* atlas, MergeOutcome* outcome) {
  for (const CommonPoint& common : plan.points) {
    const MapPoint* a = atlas->GetPoint(common.point_a);
    const MapPoint* b = atlas->GetPoint(common.point_b);
    // Points may have gone since the plan was made, or have become one.
    if (a == nullptr || b == nullptr || common.point_a == common.point_b) continue;
    const bool keep_b = b->observations.size() >= a->observations.size();
    atlas->FusePoints(keep_b ? common.point_a : common.point_b, keep_b ? common.point_b : common.point_a);
    ++outcome->num_fused;
  }
  for (const auto& [from, into] : {std::pair(&window_b_, &window_a_), std::pair(&window_a_, &window_b_)}) {
    collector_.Collect(*atlas, *from, &points_);
    for (const KeyframeHandle handle : *into) outcome->num_fused += fuser_.SearchInto(handle, points_, atlas);
  }
}

void Merger::WeldSeam(const Weld::Sides& sides, Atlas* atlas, const Clock* clock, TimePoint deadline,
                      MergeOutcome* outcome) {
  const Result<BundleSummary> summary = weld_.Adjust(sides, atlas, clock, deadline);
  outcome->num_weld_keyframes = static_cast<int>(weld_.keyframes().size());
  outcome->num_weld_points = weld_.num_points();
  if (!summary.ok()) return;
  outcome->num_weld_outliers = summary->num_outliers;
  outcome->weld_iterations = summary->iterations;
  outcome->weld_initial_cost = summary->initial_cost;
  outcome->weld_final_cost = summary->final_cost;
  outcome->weld_state = summary->state;
}

}  // namespace haustra
