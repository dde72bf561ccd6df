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
    : options_(options), slots_(static_cast<std::size_t>(max_keyframes)) {}

void EssentialGraph::Begin(const Atlas& atlas, std::span<const KeyframeHandle> keyframes,
                           std::span<const KeyframeHandle> singles) {
  for (const KeyframeHandle handle : keyframes_) slots_[handle.index] = Slot{};
  keyframes_.assign(keyframes.begin(), keyframes.end());
  singles_.assign(singles.begin(), singles.end());
  num_begun_ = keyframes_.size();
  first_adopted_ = next_ = atlas.num_keyframe_ids();
  num_grouped_ = 0;
  num_connected_ = 0;
  begin_.clear();
  anchors_.clear();
  old_poses_.clear();
  nodes_.clear();
  edges_.clear();
  linked_by_.clear();
  progress_ = PoseGraphProgress{};
}

bool EssentialGraph::CaptureNext(const Atlas& atlas) {
  if (ChooseNode(atlas)) return true;
  if (num_connected_ == num_nodes()) return false;
  linked_by_.resize(nodes_.size(), -1);
  Connect(atlas, num_connected_++);
  return true;
}

bool EssentialGraph::IsSingle(KeyframeHandle keyframe) const {
  return std::find(singles_.begin(), singles_.end(), keyframe) != singles_.end();
}

// False: all are grouped.
bool EssentialGraph::ChooseNode(const Atlas& atlas) {
  const auto is_there = [&](std::size_t i) { return atlas.GetKeyframe(keyframes_[i]) != nullptr; };
  while (num_grouped_ < num_begun_ && !is_there(num_grouped_)) ++num_grouped_;
  if (num_grouped_ == num_begun_) return false;
  const std::size_t max_nodes = static_cast<std::size_t>(options_.graph_max_nodes);
  const std::size_t group_size = (num_begun_ + max_nodes - 1) / max_nodes;
  const std::size_t begin = num_grouped_;
  std::size_t end = begin + 1;
  for (std::size_t last = begin; end < num_begun_ && end - begin < group_size; ++end) {
    if (!is_there(end)) continue;
    if (IsSingle(keyframes_[last]) || IsSingle(keyframes_[end])) break;
    if (!SharePoints(atlas, keyframes_[last], keyframes_[end])) break;
    last = end;
  }
  for (std::size_t i = begin; i < end; ++i) {
    if (!is_there(i)) continue;
    slots_[keyframes_[i].index] = {keyframes_[i].generation, num_nodes(), false};
  }
  const std::size_t middle = begin + (end - begin) / 2;
  begin_.push_back(begin);
  anchors_.push_back(keyframes_[is_there(middle) ? middle : begin]);
  old_poses_.push_back(atlas.keyframe(anchors_.back()).cam_from_map);
  nodes_.push_back({Sim3(old_poses_.back()), false});
  num_grouped_ = end;
  return true;
}

void EssentialGraph::Connect(const Atlas& atlas, int node) {
  const auto connect = [&](int a, int b, int num_shared) {
    edges_.push_back({a, b, Sim3{}, std::clamp(num_shared / kFullWeightPoints, 0.01, 1.0)});
  };
  // When the anchor has gone another one of the group tells the neighbours.
  KeyframeHandle witness = anchors_[node];
  const std::size_t end = node + 1 < num_nodes() ? begin_[node + 1] : num_begun_;
  for (std::size_t i = begin_[node]; i < end && atlas.GetKeyframe(witness) == nullptr; ++i) witness = keyframes_[i];
  covisible_.clear();
  if (atlas.GetKeyframe(witness) != nullptr) atlas.FindCovisible(witness, 1, &covisible_);
  int num_edges = 0;
  bool has_older = false;
  for (const Covisible& neighbour : covisible_) {
    const int other = NodeIndexOf(neighbour.keyframe);
    if (other < 0 || other >= node || linked_by_[other] == node) continue;  // the younger one makes the edge
    const bool is_strong = neighbour.num_shared >= options_.graph_min_shared && num_edges < options_.graph_max_edges;
    if (has_older && !is_strong) continue;
    connect(other, node, neighbour.num_shared);
    linked_by_[other] = node;
    has_older = true;
    ++num_edges;
  }
  if (!has_older && node > 0) connect(node - 1, node, 0);
}

void EssentialGraph::TakePoses(const Atlas& atlas, const Sim3& new_from_old) {
  for (int i = 0; i < num_nodes(); ++i) {
    const Keyframe* anchor = atlas.GetKeyframe(anchors_[i]);
    old_poses_[i] = anchor != nullptr ? anchor->cam_from_map : TransformPose(old_poses_[i], new_from_old);
    nodes_[i] = {Sim3(old_poses_[i]), false};
  }
  for (PoseGraphEdge& edge : edges_) edge.b_from_a = Sim3(old_poses_[edge.b] * old_poses_[edge.a].Inverse());
}

void EssentialGraph::Adopt(const Atlas& atlas, MapHandle map, bool is_tracked_side) {
  const auto& all = atlas.map(map).keyframes;
  auto first = all.end();
  while (first != all.begin() && atlas.keyframe(*(first - 1)).id >= next_) --first;
  for (; first != all.end(); ++first) {
    atlas.FindCovisible(*first, 1, &covisible_);
    // Without any it goes with the keyframe before it.
    if (covisible_.empty() && first != all.begin()) covisible_.push_back({*(first - 1), 0});
    const auto is_mine = [this](const Covisible& covisible) { return Has(covisible.keyframe); };
    const auto kin = std::find_if(covisible_.begin(), covisible_.end(), is_mine);
    const bool is_alien = !is_tracked_side && !std::all_of(covisible_.begin(), covisible_.end(), is_mine);
    if (kin == covisible_.end() || is_alien) continue;
    slots_[first->index] = {first->generation, NodeIndexOf(kin->keyframe), true};
    keyframes_.push_back(*first);
  }
  next_ = atlas.num_keyframe_ids();
}

void EssentialGraph::SetAllCorrections(const Sim3& new_from_old) {
  for (int i = 0; i < num_nodes(); ++i) nodes_[i] = {NodeOf(old_poses_[i], new_from_old), false};
}

void EssentialGraph::SetCorrection(KeyframeHandle keyframe, const Sim3& new_from_old, bool is_fixed) {
  const int i = NodeIndexOf(keyframe);
  if (i < 0) return;
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

Result<PoseGraphSummary> EssentialGraph::Solve(const std::function<bool()>& should_stop) {
  PoseGraphOptions options;
  options.max_iterations = options_.graph_iterations;
  options.should_stop = should_stop;
  options.progress = &progress_;
  return OptimizePoseGraphSim3(options, edges_, &nodes_);
}

void EssentialGraph::Apply(const Placed& placed, Atlas* atlas) const {
  std::vector<Sim3> corrections(nodes_.size());
  for (int i = 0; i < num_nodes(); ++i) corrections[i] = CorrectionOf(i);
  for (const KeyframeHandle handle : keyframes_) {
    const Keyframe* keyframe = atlas->GetKeyframe(handle);
    const Slot& slot = slots_[handle.index];
    if (keyframe == nullptr) continue;
    if (slot.is_adopted ? placed.keyframe && placed.keyframe(handle) : nodes_[slot.node].is_fixed) continue;
    const Sim3& correction = corrections[slot.node];
    atlas->CorrectKeyframe(handle, TransformPose(keyframe->cam_from_map, correction), correction.scale);
  }
  // A point goes with the oldest of its observers, which is that of the first node, and what is known of its looks with
  // it: to see that again from all observers would take as long as the map is large.
  atlas->points().ForEach([&](MapPointHandle handle, const MapPoint& point) {
    int node = num_nodes();
    bool is_held = false;
    for (const Observation& observation : point.observations) {
      const int i = NodeIndexOf(observation.keyframe);
      if (i < 0) return;
      is_held = is_held || (nodes_[i].is_fixed && !slots_[observation.keyframe.index].is_adopted);
      node = std::min(node, i);
    }
    is_held = is_held && point.first_keyframe_id < first_adopted_;
    if (placed.point ? placed.point(handle) : is_held) return;
    if (node == num_nodes()) return;
    MapPoint& moved = atlas->point(handle);
    moved.position = corrections[node] * point.position;
    moved.normal = corrections[node].rotation * point.normal;
    moved.scale_times_distance *= corrections[node].scale;
  });
}

}  // namespace haustra
