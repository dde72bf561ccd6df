#include "engine/mapping/founder.h"

#include <algorithm>
#include <map>
#include <utility>

#include "engine/optim/bundle_adjustment.h"
#include "hal/core/check.h"

namespace haustra {
namespace {

constexpr int kIterations = 20;

}  // namespace

Founder::Founder(MappingState& state)
    : state_(state), late_placement_(state.config, state.noise, state.camera, state.device) {}

// Adjusts both views and their points; false when what is left does not carry a map.
bool Founder::Adjust(const KeyframeProposal& proposal) {
  problem_.poses.assign({{SE3{}, true}, {proposal.cam_from_reference, false}});
  problem_.points.clear();
  problem_.observations.clear();
  for (int i = 0; i < proposal.num_pairs; ++i) {
    const FoundingPair& pair = proposal.pairs[i];
    problem_.points.push_back({pair.point_in_reference, false});
    const Keypoint& a = proposal.reference.features.keypoints[pair.reference_feature];
    const Keypoint& b = proposal.view.features.keypoints[pair.feature];
    problem_.observations.push_back({0, i, {a.x_px, a.y_px}, state_.noise.SigmaPx(a.scale_px), false});
    problem_.observations.push_back({1, i, {b.x_px, b.y_px}, state_.noise.SigmaPx(b.scale_px), false});
  }
  BundleOptions options;
  options.max_iterations = kIterations;
  const Result<BundleSummary> summary = AdjustBundle(state_.camera, options, &problem_);
  if (!summary.ok() || summary->state != SolveState::kConverged) return false;
  int num_good = 0;
  for (int i = 0; i < proposal.num_pairs; ++i) {
    if (!problem_.observations[2 * i].is_outlier && !problem_.observations[2 * i + 1].is_outlier) ++num_good;
  }
  return num_good >= state_.config.initialisation.min_points && num_good * 2 >= proposal.num_pairs;
}

void Founder::Fill(const KeyframeProposal& proposal, SpscRing<LatePose>* late_poses) {
  std::vector<double> depths;
  for (const BundlePoint& point : problem_.points) depths.push_back(point.position.norm());
  std::nth_element(depths.begin(), depths.begin() + depths.size() / 2, depths.end());
  const double unit = 1.0 / depths[depths.size() / 2];
  SE3 second = problem_.poses[1].cam_from_world;
  second.translation *= unit;
  reference_ = state_.atlas.AddKeyframe(state_.active, proposal.reference.frame_index, proposal.reference.timestamp,
                                        SE3{}, proposal.reference.features);
  state_.newest = state_.atlas.AddKeyframe(state_.active, proposal.view.frame_index, proposal.view.timestamp, second,
                                           proposal.view.features);
  HAUSTRA_CHECK(reference_ && state_.newest);
  AddPoints(proposal, unit);
  PlaceBetween(proposal, late_poses);
}

void Founder::AddPoints(const KeyframeProposal& proposal, double unit) {
  created_.clear();
  for (int i = 0; i < proposal.num_pairs; ++i) {
    if (problem_.observations[2 * i].is_outlier || problem_.observations[2 * i + 1].is_outlier) continue;
    const MapPointHandle point = state_.atlas.AddPoint(state_.active, unit * problem_.points[i].position,
                                                       state_.atlas.keyframe(state_.newest).id);
    if (!point) break;
    state_.atlas.AddObservation(point, reference_, proposal.pairs[i].reference_feature);
    if (!state_.atlas.AddObservation(point, state_.newest, proposal.pairs[i].feature)) {
      state_.atlas.RemovePoint(point);
      continue;
    }
    state_.atlas.UpdatePoint(point);
    created_.push_back(point);
  }
}

// Between the two views the scope is taken to have moved evenly; each frame placed corrects the guess for the next.
void Founder::PlaceBetween(const KeyframeProposal& proposal, SpscRing<LatePose>* late_poses) {
  placed_.clear();
  const SE3 second = state_.atlas.keyframe(state_.newest).cam_from_map;
  SE3 last;
  std::uint32_t last_index = proposal.reference.frame_index;
  for (int i = 0; i < proposal.num_between; ++i) {
    const ProposedView& view = proposal.between[i];
    const double share = static_cast<double>(view.frame_index - last_index) /
                         static_cast<double>(proposal.view.frame_index - last_index);
    const SE3 guess = SE3::Exp(share * (second * last.Inverse()).Log()) * last;
    PlacedView placed;
    if (late_placement_.Place(view, guess, reference_, state_.atlas, &placed)) {
      last = placed.cam_from_map;
      last_index = view.frame_index;
      placed_.push_back(std::move(placed));
    }
    state_.device.ReleaseFeatureSet(view.features.set);
  }
  Refine();
  for (const PlacedView& placed : placed_) {
    LatePose pose;
    pose.frame_index = placed.frame_index;
    pose.reference_keyframe = state_.atlas.keyframe(reference_).id;
    pose.cam_from_reference = placed.cam_from_map * state_.atlas.keyframe(reference_).cam_from_map.Inverse();
    pose.reference_scale = state_.atlas.KeyframeScale(reference_);
    pose.num_inliers = static_cast<int>(placed.sightings.size());
    late_poses->TryPush(pose);
  }
}

// Two views a short way apart leave the depths uncertain; the frames between them see the same points, too. One bundle
// adjustment of all of them, in which only the reference is held.
void Founder::Refine() {
  if (placed_.empty()) return;
  std::vector<MapPointHandle> points;
  std::map<MapPointHandle, std::int32_t> point_idx;
  problem_.poses.assign({{state_.atlas.keyframe(reference_).cam_from_map, true},
                         {state_.atlas.keyframe(state_.newest).cam_from_map, false}});
  problem_.points.clear();
  problem_.observations.clear();
  const KeyframeHandle keyframes[] = {reference_, state_.newest};
  for (const MapPointHandle handle : created_) {
    const MapPoint& point = state_.atlas.point(handle);
    const auto idx = static_cast<std::int32_t>(points.size());
    point_idx[handle] = idx;
    points.push_back(handle);
    problem_.points.push_back({point.position, false});
    for (std::int32_t k = 0; k < 2; ++k) {
      const FrameFeatures& features = state_.atlas.keyframe(keyframes[k]).features;
      const std::int32_t feature = state_.atlas.FeatureOf(point, keyframes[k]);
      problem_.observations.push_back(
          {k, idx, features.pixel(feature), state_.noise.SigmaPx(features.keypoints[feature].scale_px), false});
    }
  }
  for (const PlacedView& placed : placed_) {
    const auto pose = static_cast<std::int32_t>(problem_.poses.size());
    problem_.poses.push_back({placed.cam_from_map, false});
    for (const PlacedView::Sighting& sighting : placed.sightings) {
      problem_.observations.push_back({pose, point_idx.at(sighting.point), sighting.pixel, sighting.sigma_px, false});
    }
  }
  BundleOptions options;
  options.max_iterations = kIterations;
  const Result<BundleSummary> summary = AdjustBundle(state_.camera, options, &problem_);
  if (!summary.ok() || summary->state != SolveState::kConverged) return;
  state_.atlas.keyframe(state_.newest).cam_from_map = problem_.poses[1].cam_from_world;
  for (std::size_t i = 0; i < placed_.size(); ++i) placed_[i].cam_from_map = problem_.poses[i + 2].cam_from_world;
  for (std::size_t i = 0; i < points.size(); ++i) state_.atlas.point(points[i]).position = problem_.points[i].position;
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Without one of its two keyframes a point of a new map goes.
    if (problem_.observations[2 * i].is_outlier || problem_.observations[2 * i + 1].is_outlier) {
      state_.atlas.RemovePoint(points[i]);
    } else {
      state_.atlas.UpdatePoint(points[i]);
    }
  }
}

}  // namespace haustra
