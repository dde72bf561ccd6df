// Names of the atlas' entities. Handles are checked for staleness on every use (hal/core/slot_pool.h); ids are unique
// over the run, stable and printed in results.
#pragma once

#include <cstdint>

#include "hal/core/handle.h"

namespace haustra {

struct KeyframeTag;
struct MapPointTag;
struct MapTag;
struct MarkTag;

using KeyframeHandle = Handle<KeyframeTag>;
using MapPointHandle = Handle<MapPointTag>;
using MapHandle = Handle<MapTag>;
using MarkHandle = Handle<MarkTag>;

using KeyframeId = std::uint32_t;
using MapId = std::uint32_t;
using MarkId = std::uint32_t;
inline constexpr std::uint32_t kNoId = 0xffffffffu;

}  // namespace haustra
