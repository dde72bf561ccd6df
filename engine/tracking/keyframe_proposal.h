// What the tracker hands to the mapper: a frame that should become a keyframe, two that found a new map, or one whose
// place is to be found. Slots of a ring (hal/core/spsc_ring.h), filled and read in place. With a proposal the mapper
// becomes an owner of the feature sets in it.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/atlas/handles.h"
#include "engine/geometry/se3.h"
#include "engine/noise_model.h"
#include "hal/core/time.h"

namespace haustra {

// A pair of features of the two founding views and the point they show, in the reference camera, unit: the baseline.
struct FoundingPair {
  std::int32_t reference_feature = -1;
  std::int32_t feature = -1;
  Eigen::Vector3d point_in_reference = Eigen::Vector3d::Zero();
};

struct ProposedView {
  ProposedView() = default;
  explicit ProposedView(int max_features, std::pmr::memory_resource* memory = std::pmr::get_default_resource())
      : features(max_features, memory) {}

  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  FrameFeatures features;
};

// `count` views in one block, each with room for `max_features`.
std::pmr::vector<ProposedView> MakeViews(int count, int max_features, std::pmr::memory_resource* memory);
std::size_t BytesForViews(int count, int max_features);

// Copies frame number, time, feature set and features into a view of the same capacity; allocates nothing.
void CopyView(const ProposedView& from, ProposedView* to);

enum class ProposalKind : std::uint8_t {
  kKeyframe,   // of an existing map
  kFounding,   // two views that found a map
  kPlaceless,  // a frame without a pose: where in all maps is it?
};

struct KeyframeProposal {
  KeyframeProposal() = default;
  // max_between: frames between the views of a founding that can be carried.
  KeyframeProposal(int max_features, int max_between,
                   std::pmr::memory_resource* memory = std::pmr::get_default_resource())
      : view(max_features, memory),
        points(static_cast<std::size_t>(max_features), memory),
        reference(max_features, memory),
        pairs(static_cast<std::size_t>(max_features), memory),
        between(MakeViews(max_between, max_features, memory)) {}
  // What one takes from its arena.
  static std::size_t BytesFor(int max_features, int max_between) {
    return MemoryArena::BytesFor<MapPointHandle>(max_features) + MemoryArena::BytesFor<FoundingPair>(max_features) +
           2 * FrameFeatures::BytesFor(max_features) + BytesForViews(max_between, max_features);
  }

  ProposalKind kind = ProposalKind::kKeyframe;
  ProposedView view;
  NoiseModel noise;                   // as measured up to this frame
  std::uint64_t num_found_heard = 0;  // frames that the mapper had found and the tracker had heard of (map_reply.h)

  // A keyframe of an existing map: its pose and the points that its features were found to show.
  MapId map_id = kNoId;
  SE3 cam_from_map;
  std::uint64_t num_reframings_heard = 0;   // those that the pose has been through (map_reply.h)
  std::pmr::vector<MapPointHandle> points;  // [0, view.features.num)

  // A new map: the other view, the motion between them with a baseline of one, and the triangulated pairs.
  std::uint64_t founding_id = 0;
  ProposedView reference;
  SE3 cam_from_reference;
  std::int32_t num_pairs = 0;
  std::pmr::vector<FoundingPair> pairs;
  // The frames between the two views, oldest first: they are placed when the map stands.
  std::int32_t num_between = 0;
  std::pmr::vector<ProposedView> between;
};

}  // namespace haustra
