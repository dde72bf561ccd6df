#include "engine/tracking/keyframe_proposal.h"

#include <algorithm>

namespace haustra {

void CopyView(const ProposedView& from, ProposedView* to) {
  to->frame_index = from.frame_index;
  to->timestamp = from.timestamp;
  to->features.set = from.features.set;
  to->features.num = from.features.num;
  std::copy_n(from.features.keypoints.begin(), from.features.num, to->features.keypoints.begin());
  std::copy_n(from.features.bearings.begin(), from.features.num, to->features.bearings.begin());
}

}  // namespace haustra
