// The mapper's part of place recognition: puts the question. First, what looks like a new keyframe among all keyframes
// of all maps that are not connected with it? Connected are those that share mapping.min_shared_points with it, and
// max_shared_share of its points (place_config.h): where a scope comes back to a wall that its map has already, what
// leads there is a chain of neighbours. Then it copies what the recogniser needs to verify the best of those, together
// with the rivals of each: other places of the same map, or of the keyframe's own, that may agree as well. Reads the
// atlas only. thread-bound(mapping), deterministic.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/place/place_task.h"
#include "engine/place/retrieval.h"

namespace haustra {

class PlaceScout {
 public:
  // Everything named outlives it.
  PlaceScout(const EngineConfig& config, KeyframeRetrieval& retrieval);

  // True: the task is to be asked. False: its report says all there is to say; a device that fails leaves an entry
  // kDeviceFailed. Cost: some milliseconds each, for lists and copies.
  bool Begin(const Atlas& atlas, KeyframeHandle keyframe, PlaceTask* task);
  // After kRetrieve. The task's keyframe is alive; candidates that have gone are left out.
  bool GoOn(const Atlas& atlas, PlaceTask* task);

  std::uint64_t num_points_left_out() const { return copier_.num_points_left_out(); }

 private:
  void MarkConnected(const Atlas& atlas, KeyframeHandle keyframe);
  bool CopyCandidates(const Atlas& atlas, PlaceTask* task);
  bool ReportFailure(const Atlas& atlas, PlaceTask* task);
  int Copy(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task);
  void NameRivals(const Atlas& atlas, std::size_t retrieved_idx, PlaceTask* task);

  const EngineConfig& config_;
  KeyframeRetrieval& retrieval_;
  ExcerptCopier copier_;
  std::vector<std::int32_t> strongest_;
  std::vector<int> candidate_of_;           // of what was retrieved: position in the task, -1: not copied
  std::vector<std::uint8_t> is_connected_;  // by keyframe slot
  std::vector<KeyframeHandle> connected_;
  std::vector<Covisible> covisible_;
};

}  // namespace haustra
