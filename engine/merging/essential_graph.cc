#include "engine/merging/essential_graph.h"

#include <algorithm>

namespace haustra {
namespace {

// Shared points that make an edge as strong as any.
constexpr double kFullWeightPoints = 100.0;

// Of many points a few tell whether two keyframes are neighbours.
constexpr int kPointStep = 8;

bool SharePoints(const Atlas& atlas, KeyframeHandle a, KeyframeHandle b) {
  const Keyframe& keyframe = atlas.keyframe(a);
  int num_seen = 0;
  for (int i = 0; i < keyframe.features.num; ++i) {
    if (!keyframe.points[i] || num_seen++ % kPointStep != 0) continue;
    if (atlas.FeatureOf(atlas.point(keyframe.points[i]), b) >= 0) return true;
  }
  return false;
}

// The node keeps its own, old unit: x_node = old_pose * point_old = node_from_world * (new_from_old * point_old).
Sim3 NodeOf(const SE3& old_pose, const Sim3& new_from_old) { return Sim3(old_pose) * new_from_old.Inverse(); }

}  // namespace

EssentialGraph::EssentialGraph(const MergingConfig& options, int max_keyframes)
    : options_(options), slots_(static_cast<std::size_t>(max_keyframes), -1) {}

void EssentialGraph::Capture(const Atlas& atlas, std::span<const KeyframeHandle> keyframes,
                             std::span<const KeyframeHandle> singles) {
  for (const KeyframeHandle handle : keyframes_) slots_[handle.index] = -1;
  keyframes_.assign(keyframes.begin(), keyframes.end());
  ChooseNodes(atlas, singles);
  Connect(atlas);
}

void EssentialGraph::ChooseNodes(const Atlas& atlas, std::span<const KeyframeHandle> singles) {
  anchors_.clear();
  old_poses_.clear();
  nodes_.clear();
  const std::size_t max_nodes = static_cast<std::size_t>(options_.graph_max_nodes);
  const std::size_t group_size = (keyframes_.size() + max_nodes - 1) / max_nodes;
  const auto is_single = [&](KeyframeHandle handle) {
    return std::find(singles.begin(), singles.end(), handle) != singles.end();
  };
  for (std::size_t begin = 0, end = 0; begin < keyframes_.size(); begin = end) {
    end = begin + 1;
    while (end < keyframes_.size() && end - begin < group_size && !is_single(keyframes_[end - 1]) &&
           !is_single(keyframes_[end]) && SharePoints(atlas, keyframes_[end - 1], keyframes_[end])) {
      ++end;
    }
    for (std::size_t i = begin; i < end; ++i) slots_[keyframes_[i].index] = static_cast<std::int32_t>(nodes_.size());
    anchors_.push_back(keyframes_[begin + (end - begin) / 2]);
    old_poses_.push_back(atlas.keyframe(anchors_.back()).cam_from_map);
    nodes_.push_back({Sim3(old_poses_.back()), false});
  }
}

void EssentialGraph::Connect(const Atlas& atlas) {
  edges_.clear();
  linked_by_.assign(nodes_.size(), -1);
  const auto connect = [&](int a, int b, int num_shared) {
    const Sim3 b_from_a(old_poses_[b] * old_poses_[a].Inverse());
    edges_.push_back({a, b, b_from_a, std::clamp(num_shared / kFullWeightPoints, 0.01, 1.0)});
  };
  for (int self = 0; self < num_nodes(); ++self) {
    atlas.FindCovisible(anchors_[self], 1, &covisible_);
    int num_edges = 0;
    bool has_older = false;
    for (const Covisible& neighbour : covisible_) {
      const int other = NodeIndexOf(neighbour.keyframe);
      if (other < 0 || other >= self || linked_by_[other] == self) continue;  // the younger one makes the edge
      const bool is_strong = neighbour.num_shared >= options_.graph_min_shared && num_edges < options_.graph_max_edges;
      if (has_older && !is_strong) continue;
      connect(other, self, neighbour.num_shared);
      linked_by_[other] = self;
      has_older = true;
      ++num_edges;
    }
    if (!has_older && self > 0) connect(self - 1, self, 0);
  }
}

void EssentialGraph::SetCorrection(KeyframeHandle keyframe, const Sim3& new_from_old, bool is_fixed) {
  const int i = NodeIndexOf(keyframe);
  nodes_[i].node_from_world = NodeOf(old_poses_[i], new_from_old);
  nodes_[i].is_fixed = is_fixed;
}

void EssentialGraph::AddJoint(KeyframeHandle a, KeyframeHandle b, double weight) {
  const int i = NodeIndexOf(a), j = NodeIndexOf(b);
  edges_.push_back({i, j, nodes_[j].node_from_world * nodes_[i].node_from_world.Inverse(), weight});
}

Sim3 EssentialGraph::CorrectionOf(int node) const {
  return nodes_[node].node_from_world.Inverse() * Sim3(old_poses_[node]);
}

Sim3 EssentialGraph::Correction(KeyframeHandle keyframe) const { return CorrectionOf(NodeIndexOf(keyframe)); }

Result<PoseGraphSummary> EssentialGraph::Solve(const Clock* clock, TimePoint deadline) {
  PoseGraphOptions options;
  options.max_iterations = options_.graph_iterations;
  options.clock = clock;
  options.deadline = deadline;
  return OptimizePoseGraphSim3(options, edges_, &nodes_);
}

void EssentialGraph::Apply(Atlas* atlas) {
  std::vector<Sim3> corrections(nodes_.size());
  for (int i = 0; i < num_nodes(); ++i) corrections[i] = CorrectionOf(i);
  for (const KeyframeHandle handle : keyframes_) {
    const int i = NodeIndexOf(handle);
    if (nodes_[i].is_fixed) continue;
    const SE3 old_pose = atlas->keyframe(handle).cam_from_map;
    atlas->CorrectKeyframe(handle, TransformPose(old_pose, corrections[i]), corrections[i].scale);
  }
  // A point goes with the oldest of its observers, and what is known of its looks with it: to see that again from all
  // observers would take as long as the map is large.
  atlas->points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    KeyframeId oldest = kNoId;
    int node = -1;
    for (const Observation& observation : point.observations) {
      const int i = NodeIndexOf(observation.keyframe);
      if (i < 0 || nodes_[i].is_fixed) return;
      const KeyframeId id = atlas->keyframe(observation.keyframe).id;
      if (node >= 0 && id > oldest) continue;
      oldest = id;
      node = i;
    }
    if (node < 0) return;
    MapPoint& moved = atlas->point(handle);
    moved.position = corrections[node] * point.position;
    moved.normal = corrections[node].rotation * point.normal;
    moved.scale_times_distance *= corrections[node].scale;
  });
}

}  // namespace haustra
