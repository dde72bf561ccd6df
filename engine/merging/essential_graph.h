// Spreads a correction over keyframes that are held together by their relative poses (Sim(3), so that scale drift
// spreads too): the essential graph of Mur-Artal et al. 2015, section VII-D, with edges to the strongest covisible
// keyframes and one to an older neighbour so that nothing falls apart. Points follow a keyframe that sees them.
// A node is one keyframe, or in a map with more than graph_max_nodes of them a group: keyframes made one after the
// other that share points. A group moves in one piece, and the keyframe in its middle stands for it in the graph. Cost:
// FindCovisible and the edges are bounded by graph_max_nodes; Apply is linear in the keyframes and points of the atlas.
// thread-bound(mapping); allocates.
#pragma once

#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/merging/merging_config.h"
#include "engine/optim/pose_graph.h"

namespace haustra {

class EssentialGraph {
 public:
  EssentialGraph(const MergingConfig& options, int max_keyframes);

  // Takes the keyframes' present poses as what their relative poses should be, and their covisibility as edges.
  // `keyframes` in the order of their ids. Those of `singles` that are among them have a node each.
  void Capture(const Atlas& atlas, std::span<const KeyframeHandle> keyframes, std::span<const KeyframeHandle> singles);

  // Where the correction is known: the frame around this keyframe (which was captured) moved by new_from_old, and its
  // group with it. A fixed one stays there; of one that is not fixed this is the first guess.
  void SetCorrection(KeyframeHandle keyframe, const Sim3& new_from_old, bool is_fixed);
  // An additional edge: both keyframes' frames as corrected so far should keep their relative pose.
  void AddJoint(KeyframeHandle a, KeyframeHandle b, double weight);
  // Of the last Capture and Solve, or as set.
  Sim3 Correction(KeyframeHandle keyframe) const;

  // Unless it converges all corrections stay as they were set.
  Result<PoseGraphSummary> Solve(const Clock* clock, TimePoint deadline);

  // Writes the poses of all keyframes that are not fixed, and moves the points that only such keyframes see.
  void Apply(Atlas* atlas);

  int num_nodes() const { return static_cast<int>(nodes_.size()); }
  int num_edges() const { return static_cast<int>(edges_.size()); }

 private:
  int NodeIndexOf(KeyframeHandle keyframe) const { return slots_[keyframe.index]; }
  void ChooseNodes(const Atlas& atlas, std::span<const KeyframeHandle> singles);
  void Connect(const Atlas& atlas);
  Sim3 CorrectionOf(int node) const;

  const MergingConfig& options_;
  std::vector<KeyframeHandle> keyframes_;
  std::vector<KeyframeHandle> anchors_;  // of each node: the keyframe that stands for it
  std::vector<SE3> old_poses_;           // of the anchors
  std::vector<PoseGraphNode> nodes_;     // in order of the ids of their oldest keyframes
  std::vector<PoseGraphEdge> edges_;
  std::vector<std::int32_t> slots_;  // by keyframe slot: index in nodes_, -1
  std::vector<int> linked_by_;       // by node: the last node that made an edge to it
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
