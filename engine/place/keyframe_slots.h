// Which keyframe of the atlas has which slot of a retrieval: places are fixed at construction, and what a retrieval
// keeps of a keyframe lies at its slot. thread-bound(its owner), no call allocates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/atlas/atlas.h"
#include "hal/core/status.h"

namespace haustra {

class KeyframeSlots {
 public:
  explicit KeyframeSlots(int max_keyframes) : keyframes_(static_cast<std::size_t>(max_keyframes)) {}
  static std::size_t BytesFor(int max_keyframes) {
    return static_cast<std::size_t>(max_keyframes) * sizeof(KeyframeHandle);
  }

  std::size_t size() const { return keyframes_.size(); }
  // Of a slot; invalid: it is free.
  KeyframeHandle operator[](std::size_t slot) const { return keyframes_[slot]; }

  // The first slot that is free, which Take then gives to a keyframe. kCapacityExceeded: none is.
  Result<std::uint32_t> FindFree() const;
  void Take(std::uint32_t slot, KeyframeHandle keyframe) { keyframes_[slot] = keyframe; }
  // Frees the keyframe's slot and says which it was; nothing: it has none.
  std::optional<std::uint32_t> Release(KeyframeHandle keyframe);

 private:
  std::vector<KeyframeHandle> keyframes_;
};

}  // namespace haustra
