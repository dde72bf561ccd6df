// Founds maps: adjusts the two views of a founding, and when they carry a map fills it with two keyframes
// and their points, finds the frames between the views in it, and adjusts all of them once more. The unit of a new map
// is its median depth in the first view. thread-bound(mapping); uses the heap (Ceres).
#pragma once

#include <span>
#include <vector>

#include "engine/mapping/late_placement.h"
#include "engine/mapping/mapping_state.h"
#include "hal/core/spsc_ring.h"

namespace haustra {

class Founder {
 public:
  // The state outlives it.
  explicit Founder(MappingState& state);

  // Adjusts both views and their points; false when what is left does not carry a map. Touches nothing else.
  bool Adjust(const KeyframeProposal& proposal);

  // After Adjust, with an empty map that is the active one, and room for two keyframes: fills it and makes the second
  // view the newest keyframe. Takes over the feature sets of both views and releases those of the views between, whose
  // poses go to `late_poses`.
  void Fill(const KeyframeProposal& proposal, SpscRing<LatePose>* late_poses);

  // Of the last Fill: the first keyframe, and the points that were made; some may have gone again.
  KeyframeHandle reference() const { return reference_; }
  std::span<const MapPointHandle> created() const { return created_; }

 private:
  void AddPoints(const KeyframeProposal& proposal, double unit);
  void PlaceBetween(const KeyframeProposal& proposal, SpscRing<LatePose>* late_poses);
  void Refine();

  MappingState& state_;
  LatePlacement late_placement_;
  BundleProblem problem_;
  KeyframeHandle reference_;
  std::vector<MapPointHandle> created_;
  std::vector<PlacedView> placed_;  // between the founding views
};

}  // namespace haustra
