// Takes a proposed keyframe into the active map: links it by appearance, checks the relief of a young map, searches its
// neighbours' points in it and back, judges points on trial, makes new points, adjusts the window, culls keyframes that
// add nothing. In real-time mode the new points are published before the window is adjusted. While a seam is open
// (mapping_state.h) nothing is adjusted. thread-bound(mapping).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/mapping/evictor.h"
#include "engine/mapping/local_bundle.h"
#include "engine/mapping/mapping_state.h"
#include "engine/mapping/mark_keeper.h"
#include "engine/mapping/point_creation.h"
#include "engine/mapping/point_fusion.h"
#include "engine/mapping/point_trial.h"
#include "engine/mapping/relief_check.h"
#include "engine/mapping/snapshot_publisher.h"
#include "engine/mapping/track_linker.h"
#include "engine/place/retrieval.h"

namespace haustra {

class KeyframeInserter {
 public:
  struct Parts {
    SnapshotPublisher& publisher;
    KeyframeRetrieval& retrieval;  // keyframes that are culled are taken out of it
    Evictor& evictor;
    PointTrial& trial;
    LocalBundle& bundle;
    SchurBundleAdjuster& adjuster;
    MarkKeeper& marks;
  };
  // All of them outlive it.
  KeyframeInserter(MappingState& state, Parts parts);

  // The new keyframe, which is the newest one then. Invalid: its map is no longer the active one, was built anew since
  // or moved too often, or the pool is full (counted). Takes over the feature set in any case; that of a refused
  // keyframe goes at once: no snapshot has ever named it.
  KeyframeHandle Insert(const KeyframeProposal& proposal);
  // A keyframe for which the pool had no room, here or elsewhere; or a founding's `wanted` ones.
  void CountRefused(KeyframeId wanted = 1);

 private:
  KeyframeHandle AddKeyframe(const KeyframeProposal& proposal, const SE3& cam_from_map);
  void LinkToNeighbours(KeyframeHandle handle);
  void CreatePoints(KeyframeHandle handle);
  void SearchInNeighbours(KeyframeHandle handle);
  void CheckRelief(KeyframeHandle handle);
  void AdjustAround(KeyframeHandle handle, const LocalBundle::Extent& extent, bool may_be_interrupted);
  void CollectPoints(std::span<const Covisible> keyframes, int max_keyframes, std::vector<MapPointHandle>* out);
  void CullKeyframes(KeyframeHandle newest);
  bool IsRedundant(KeyframeHandle handle) const;

  MappingState& state_;
  SnapshotPublisher& publisher_;
  KeyframeRetrieval& retrieval_;
  Evictor& evictor_;
  PointTrial& trial_;
  LocalBundle& bundle_;
  MarkKeeper& marks_;
  PointCreator creator_;
  PointFuser fuser_;
  TrackLinker linker_;
  ReliefCheck relief_;
  std::vector<MapPointHandle> candidates_;
  std::vector<MapPointHandle> created_;
  std::vector<Covisible> covisible_;        // neighbours of the keyframe that is inserted
  std::vector<std::uint8_t> is_candidate_;  // by point slot
};

}  // namespace haustra
