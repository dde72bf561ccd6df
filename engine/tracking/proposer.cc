#include "engine/tracking/proposer.h"

#include <algorithm>
#include <cmath>

#include "engine/geometry/constants.h"

namespace haustra {

Proposer::Proposer(const EngineConfig& config, VisionDevice& device, TrackingLink& link, const NoiseModel& noise,
                   const ProposedView& frame, const RepliesHeard& heard)
    : config_(config), device_(device), link_(link), noise_(noise), frame_(frame), heard_(heard) {}

bool Proposer::IsKeyframe(const Tracking& tracking, const PoseEstimate& estimate, const LocalMap& map,
                          const LocalKeyframe& reference, bool has_fewer_points) const {
  const KeyframeConfig& options = config_.keyframes;
  const Course& course = tracking.course;
  // What the ladder leaves out is not lost from sight. A reference that was reduced itself has left it out, too.
  const bool is_reduced = frame_.features.is_reduced;
  const double of_frame = SearchedShare(config_.scheduler, has_fewer_points, is_reduced);
  const double of_reference = SearchedShare(config_.scheduler, has_fewer_points, is_reduced && !reference.is_reduced);
  const double spacing_ms = ToMilliseconds(Apart(frame_.timestamp, course.keyframe_time));
  const bool is_thin = static_cast<double>(estimate.matches.size()) < options.low_inliers * of_frame;
  // A map that has become thin is lost in the next frames unless it grows. A young one has little to lose. One of few
  // keyframes around here is taken for young, too.
  const bool is_young = map.is_young(config_.mapping.min_map_keyframes);
  // Points made of the last keyframes alone may be on something that came between the scope and the wall.
  const bool shows_wall = estimate.num_seasoned >= config_.tracking.min_inliers;
  const bool may_be_soon = is_thin && (is_young || shows_wall);
  if ((spacing_ms < options.min_spacing_ms && !may_be_soon) || is_mapper_busy()) return false;
  if (estimate.num_established < config_.tracking.min_inliers && !is_young) return false;
  const double baseline =
      (estimate.cam_from_map.InverseTranslation() - course.keyframe_from_map.InverseTranslation()).norm();
  const double parallax_deg = std::atan2(baseline, estimate.median_depth) / kDegree;
  const bool has_left_reference =
      estimate.num_established < options.min_tracked_ratio * of_reference * reference.num_established;
  const bool has_moved = parallax_deg > options.min_parallax_deg;
  const bool is_late = spacing_ms >= options.max_spacing_ms && parallax_deg > 0.25 * options.min_parallax_deg;
  return has_left_reference || is_thin || has_moved || is_late;
}

KeyframeProposal* Proposer::Begin(ProposalKind kind) {
  KeyframeProposal* slot = link_.proposals.BeginPush();
  if (slot == nullptr) return nullptr;
  slot->kind = kind;
  slot->noise = noise_;
  CopyView(frame_, &slot->view);
  return slot;
}

void Proposer::Commit() {
  link_.num_pending.fetch_add(1, std::memory_order_acq_rel);
  link_.proposals.CommitPush();
}

// Shared before the mapper can see it: one that refuses the keyframe releases the set at once.
bool Proposer::ProposeKeyframe(const PoseEstimate& estimate, const LocalMap& map, Tracking* tracking) {
  if (!device_.RetainFeatureSet(frame_.features.set)) return false;
  KeyframeProposal* slot = Begin(ProposalKind::kKeyframe);
  if (slot == nullptr) {
    device_.ReleaseFeatureSet(frame_.features.set);
    return false;
  }
  slot->map_id = tracking->course.map_id;
  slot->cam_from_map = estimate.cam_from_map;
  slot->num_reframings_heard = heard_.num_reframings;
  std::fill_n(slot->points.begin(), frame_.features.num, MapPointHandle{});
  for (const PointMatch& match : estimate.matches) {
    slot->points[match.feature_idx] = map.points[match.point_idx].handle;
  }
  Commit();
  tracking->course.keyframe_time = frame_.timestamp;
  tracking->course.keyframe_from_map = estimate.cam_from_map;
  return true;
}

std::optional<AwaitingMap> Proposer::ProposeMap(const Lost& lost, Initialiser* initialiser) {
  KeyframeProposal* slot = Begin(ProposalKind::kFounding);
  if (slot == nullptr) return std::nullopt;
  slot->num_found_heard = heard_.num_found;
  slot->founding_id = next_founding_id_++;
  initialiser->MoveInto(slot);
  Commit();
  return Await(lost, slot->founding_id, frame_.frame_index);
}

bool Proposer::AskForPlace() {
  if (is_mapper_busy() || !device_.RetainFeatureSet(frame_.features.set)) return false;
  if (Begin(ProposalKind::kPlaceless) == nullptr) {
    device_.ReleaseFeatureSet(frame_.features.set);
    return false;
  }
  Commit();
  return true;
}

}  // namespace haustra
