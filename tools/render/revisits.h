// Pairs of frames that see the same place long after one another. reentrant.
#pragma once

#include <vector>

#include "engine/geometry/se3.h"
#include "tools/render/event_script.h"

namespace haustra::render {

struct Revisit {
  int frame_a = 0, frame_b = 0;  // a < b
  double dt_s = 0.0;
  double distance_mm = 0.0;
  double axis_angle_deg = 0.0;  // between the two optical axes
};

// For one frame a second the best later frame, at least 10 s after it (or a third of the sequence, when that is less),
// within 10 mm and 12 degrees, roll included; frames of events are left out. world_from_cam: one a frame.
std::vector<Revisit> FindRevisits(const std::vector<SE3>& world_from_cam, double rate_hz,
                                  const std::vector<FrameSpan>& hidden);

}  // namespace haustra::render
