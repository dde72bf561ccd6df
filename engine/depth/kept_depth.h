// What is kept of the depth of a keyframe.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <vector>

#include "engine/atlas/handles.h"
#include "engine/surface/depth_map.h"

namespace haustra {

struct KeptDepth {
  KeptDepth(int width, int height, std::pmr::memory_resource* memory)
      : depth(width, height, memory), bgr(std::size_t(3) * width * height, memory) {}
  static std::size_t BytesFor(int num_cells) {
    return DepthMap::BytesFor(num_cells) + MemoryArena::BytesFor<std::uint8_t>(std::size_t(3) * num_cells);
  }

  KeyframeHandle keyframe;  // invalid or stale: there is none
  // Atlas::KeyframeScale when it was made: its ranges are to be multiplied by what that is now over this.
  double scale = 1.0;
  std::uint64_t turned_at = 0;  // Keyframe::turned_at likewise; at another one it is of another shape
  DepthMap depth;
  std::pmr::vector<std::uint8_t> bgr;  // blue, green, red of the picture in the middle of each cell
};

}  // namespace haustra
