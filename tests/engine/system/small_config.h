// An engine of a size that tests map in seconds with.
#pragma once

#include "engine/config.h"

namespace haustra::test {

inline EngineConfig SmallEngineConfig() {
  EngineConfig config;
  config.features.max = 600;
  config.memory.max_keyframes = 200;
  config.memory.max_map_points = 30000;
  config.memory.max_maps = 16;
  config.memory.max_keyframe_ids = 1000;
  config.memory.max_local_points = 6000;
  return config;
}

}  // namespace haustra::test
