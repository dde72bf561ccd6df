#include "engine/place/keyframe_slots.h"

#include <algorithm>
#include <string>

namespace haustra {

Result<std::uint32_t> KeyframeSlots::FindFree() const {
  const auto free = std::find_if(keyframes_.begin(), keyframes_.end(), [](KeyframeHandle k) { return !k.is_valid(); });
  if (free == keyframes_.end()) {
    return CapacityExceeded("retrieval: " + std::to_string(keyframes_.size()) + " keyframes are all there is room for");
  }
  return static_cast<std::uint32_t>(free - keyframes_.begin());
}

std::optional<std::uint32_t> KeyframeSlots::Release(KeyframeHandle keyframe) {
  if (!keyframe.is_valid()) return std::nullopt;
  const auto found = std::find(keyframes_.begin(), keyframes_.end(), keyframe);
  if (found == keyframes_.end()) return std::nullopt;
  *found = {};
  return static_cast<std::uint32_t>(found - keyframes_.begin());
}

}  // namespace haustra
