#include "engine/tracking/keyframe_proposal.h"

#include <algorithm>

namespace haustra {

std::pmr::vector<ProposedView> MakeViews(int count, int max_features, std::pmr::memory_resource* memory) {
  std::pmr::vector<ProposedView> views(memory);
  views.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) views.emplace_back(max_features, memory);
  return views;
}

std::size_t BytesForViews(int count, int max_features) {
  return MemoryArena::BytesFor<ProposedView>(static_cast<std::size_t>(count)) +
         static_cast<std::size_t>(count) * FrameFeatures::BytesFor(max_features);
}

void CopyView(const ProposedView& from, ProposedView* to) {
  to->frame_index = from.frame_index;
  to->timestamp = from.timestamp;
  to->features.set = from.features.set;
  to->features.num = from.features.num;
  to->features.num_followed = from.features.num_followed;
  to->features.is_reduced = from.features.is_reduced;
  std::copy_n(from.features.keypoints.begin(), from.features.num, to->features.keypoints.begin());
  std::copy_n(from.features.bearings.begin(), from.features.num, to->features.bearings.begin());
}

}  // namespace haustra
