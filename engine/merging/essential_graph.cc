#include "engine/merging/essential_graph.h"

#include <algorithm>

namespace haustra {
namespace {

// Shared points that make an edge as strong as any.
constexpr double kFullWeightPoints = 100.0;

// The node keeps its own, old unit: x_node = old_pose * point_old = node_from_world * (new_from_old * point_old).
Sim3 NodeOf(const SE3& old_pose, const Sim3& new_from_old) { return Sim3(old_pose) * new_from_old.Inverse(); }

}  // namespace

EssentialGraph::EssentialGraph(const MergingConfig& options, int max_keyframes)
    : options_(options), slots_(static_cast<std::size_t>(max_keyframes), -1) {}

void EssentialGraph::Capture(const Atlas& atlas, std::span<const KeyframeHandle> keyframes) {
  for (const KeyframeHandle handle : keyframes_) slots_[handle.index] = -1;
  keyframes_.assign(keyframes.begin(), keyframes.end());
  old_poses_.clear();
  nodes_.clear();
  edges_.clear();
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    slots_[keyframes_[i].index] = static_cast<std::int32_t>(i);
    old_poses_.push_back(atlas.keyframe(keyframes_[i]).cam_from_map);
    nodes_.push_back({Sim3(old_poses_.back()), false});
  }
  const auto connect = [&](int a, int b, int num_shared) {
    const Sim3 b_from_a(old_poses_[b] * old_poses_[a].Inverse());
    edges_.push_back({a, b, b_from_a, std::clamp(num_shared / kFullWeightPoints, 0.01, 1.0)});
  };
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    const int self = static_cast<int>(i);
    const KeyframeId id = atlas.keyframe(keyframes_[i]).id;
    atlas.FindCovisible(keyframes_[i], 1, &covisible_);
    int num_edges = 0;
    bool has_older = false;
    for (const Covisible& neighbour : covisible_) {
      const int other = IndexOf(neighbour.keyframe);
      if (other < 0 || atlas.keyframe(neighbour.keyframe).id > id) continue;  // the younger one makes the edge
      const bool is_strong = neighbour.num_shared >= options_.graph_min_shared && num_edges < options_.graph_max_edges;
      if (has_older && !is_strong) continue;
      connect(other, self, neighbour.num_shared);
      has_older = true;
      ++num_edges;
    }
    if (!has_older && i > 0) connect(self - 1, self, 0);
  }
}

void EssentialGraph::SetCorrection(KeyframeHandle keyframe, const Sim3& new_from_old, bool is_fixed) {
  const int i = IndexOf(keyframe);
  nodes_[i].node_from_world = NodeOf(old_poses_[i], new_from_old);
  nodes_[i].is_fixed = is_fixed;
}

void EssentialGraph::AddJoint(KeyframeHandle a, KeyframeHandle b, double weight) {
  const int i = IndexOf(a), j = IndexOf(b);
  edges_.push_back({i, j, nodes_[j].node_from_world * nodes_[i].node_from_world.Inverse(), weight});
}

Sim3 EssentialGraph::Correction(KeyframeHandle keyframe) const {
  const int i = IndexOf(keyframe);
  return nodes_[i].node_from_world.Inverse() * Sim3(old_poses_[i]);
}

Result<PoseGraphSummary> EssentialGraph::Solve(const Clock* clock, TimePoint deadline) {
  PoseGraphOptions options;
  options.max_iterations = options_.graph_iterations;
  options.clock = clock;
  options.deadline = deadline;
  return OptimizePoseGraphSim3(options, edges_, &nodes_);
}

void EssentialGraph::Apply(Atlas* atlas) {
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    if (nodes_[i].is_fixed) continue;
    const Sim3 new_from_old = Correction(keyframes_[i]);
    atlas->CorrectKeyframe(keyframes_[i], TransformPose(old_poses_[i], new_from_old), new_from_old.scale);
  }
  // A point goes with the oldest of its observers.
  std::vector<MapPointHandle> moved;
  atlas->points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    KeyframeHandle anchor;
    for (const Observation& observation : point.observations) {
      const int i = IndexOf(observation.keyframe);
      if (i < 0 || nodes_[i].is_fixed) return;
      if (!anchor || atlas->keyframe(observation.keyframe).id < atlas->keyframe(anchor).id) {
        anchor = observation.keyframe;
      }
    }
    if (!anchor) return;
    atlas->point(handle).position = Correction(anchor) * point.position;
    moved.push_back(handle);
  });
  for (const MapPointHandle handle : moved) atlas->UpdatePoint(handle);
}

}  // namespace haustra
