// Where a frame was, for who wants to say something about it later: the tracker tells the mapper of every frame it has
// answered, and the mapper keeps the last ones (engine/mapping/mark_keeper.h). Plain data.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/atlas/handles.h"
#include "engine/camera/dark_surround.h"
#include "engine/geometry/se3.h"
#include "hal/core/time.h"

namespace haustra {

// Ten seconds at 50 frames a second: as long as it takes to point at what one has seen.
inline constexpr std::size_t kKeptAnswers = 512;

struct AnsweredFrame {
  std::uint64_t number = 0;  // among all that were answered, from 1; TrackingLink::Answer gives it
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  std::uint64_t map_epoch = 0;            // reframings that tracking had heard of
  KeyframeId reference_keyframe = kNoId;  // kNoId: no pose was measured
  SE3 cam_from_reference;
  double reference_scale = 1.0;
  DarkSurround surround;  // of its picture, where a pose was measured and no mask says what shows the scene
};

}  // namespace haustra
