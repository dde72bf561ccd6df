// Spreads a correction over keyframes that are held together by their relative poses (Sim(3), so that scale drift
// spreads too): the essential graph of Mur-Artal et al. 2015, section VII-D, with edges to the strongest covisible
// keyframes and one to an older neighbour so that nothing falls apart. Points follow a keyframe that sees them.
// A node is one keyframe, or in a map with more than graph_max_nodes of them a group: keyframes made one after the
// other that share points. A group moves in one piece, and the keyframe in its middle stands for it in the graph.
//
// Made in pieces, between which the atlas may go on: Begin, CaptureNext until it says so, TakePoses, corrections, Solve
// until it says so, Apply. A keyframe that goes meanwhile leaves its node behind; one that comes is adopted (Adopt): it
// follows the node of the keyframe of the graph that it shares most points with. Cost: a piece of CaptureNext is one
// FindCovisible at most, and their number is bounded by graph_max_nodes and the groups; Apply is linear in the
// keyframes and points of the atlas. thread-bound(mapping); allocates.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/merging/join_limits.h"
#include "engine/merging/merging_config.h"
#include "engine/optim/pose_graph.h"

namespace haustra {

class EssentialGraph {
 public:
  EssentialGraph(const MergingConfig& options, int max_keyframes);

  // Forgets all it knew. `keyframes` in the order of their ids. Those of `singles` that are among them have a node
  // each.
  void Begin(const Atlas& atlas, std::span<const KeyframeHandle> keyframes, std::span<const KeyframeHandle> singles);
  // The next group of keyframes, or when all are grouped the edges of the next node, by covisibility. False: no more.
  bool CaptureNext(const Atlas& atlas);
  // Takes the present poses as what the relative poses should be. `new_from_old`: how the map was moved since Begin.
  void TakePoses(const Atlas& atlas, const Sim3& new_from_old);
  // Keyframes of the map that are newer than those of Begin and of the last Adopt. Where the map holds keyframes
  // outside the graph, too, one that shares points with both sides belongs to the one where tracking came from.
  void Adopt(const Atlas& atlas, MapHandle map, bool is_tracked_side);

  // Begun with, or adopted.
  bool Has(KeyframeHandle keyframe) const { return NodeIndexOf(keyframe) >= 0; }
  // Begun with and then adopted; some may have gone.
  std::span<const KeyframeHandle> keyframes() const { return keyframes_; }
  bool has_adopted() const { return keyframes_.size() > num_begun_; }

  // The first guess for all.
  void SetAllCorrections(const Sim3& new_from_old);
  // Where the correction is known: the frame around this keyframe moved by new_from_old, and its group with it. A fixed
  // one stays there; of one that is not fixed this is the first guess. Of a keyframe that the graph lacks: nothing.
  void SetCorrection(KeyframeHandle keyframe, const Sim3& new_from_old, bool is_fixed);
  // An additional edge: both keyframes' frames as corrected so far should keep their relative pose.
  void AddJoint(KeyframeHandle a, KeyframeHandle b, double weight);

  // Goes on where it was stopped. Unless it converges all corrections stay as they were set.
  Result<PoseGraphSummary> Solve(const std::function<bool()>& should_stop);

  // What is in its place already. Who sees a point when the graph is applied does not say whether it was placed with
  // them: it may have been found in a keyframe since, or in one more.
  struct Placed {
    std::function<bool(KeyframeHandle)> keyframe;  // of those adopted; empty: none
    std::function<bool(MapPointHandle)> point;     // empty: points as old as the graph that a fixed keyframe sees
  };
  // Moves all keyframes from where they are now, but for those of fixed nodes that are as old as the graph, and the
  // points that only keyframes of the graph see.
  void Apply(const Placed& placed, Atlas* atlas) const;

  int num_nodes() const { return static_cast<int>(nodes_.size()); }
  int num_edges() const { return static_cast<int>(edges_.size()); }

 private:
  struct Slot {
    std::uint32_t generation = 0;
    std::int32_t node = -1;
    bool is_adopted = false;
  };

  int NodeIndexOf(KeyframeHandle keyframe) const {
    const Slot& slot = slots_[keyframe.index];
    return slot.generation == keyframe.generation ? slot.node : -1;
  }
  bool IsSingle(KeyframeHandle keyframe) const;
  bool ChooseNode(const Atlas& atlas);
  void Connect(const Atlas& atlas, int node);
  Sim3 CorrectionOf(int node) const;

  const MergingConfig& options_;
  std::vector<KeyframeHandle> keyframes_;
  std::vector<KeyframeHandle> singles_;
  std::size_t num_begun_ = 0;            // of keyframes_; the others were adopted
  KeyframeId first_adopted_ = 0;         // keyframes and points from this one on are newer than the graph
  KeyframeId next_ = 0;                  // the first keyframe that no Adopt has seen
  std::size_t num_grouped_ = 0;          // of keyframes_
  int num_connected_ = 0;                // of nodes_
  std::vector<std::size_t> begin_;       // of each node: its first keyframe in keyframes_
  std::vector<KeyframeHandle> anchors_;  // of each node: the keyframe that stands for it
  std::vector<SE3> old_poses_;           // of the anchors
  std::vector<PoseGraphNode> nodes_;     // in order of the ids of their oldest keyframes
  std::vector<PoseGraphEdge> edges_;
  PoseGraphProgress progress_;
  std::vector<Slot> slots_;     // by keyframe slot
  std::vector<int> linked_by_;  // by node: the last node that made an edge to it
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
