// One instant of an exposure: what the renderer needs to know about it.
#pragma once

#include "engine/geometry/se3.h"
#include "tools/render/instrument.h"

namespace haustra::render {

struct ExposureMoment {
  double time_s = 0.0;
  double arc_mm = 0.0;  // where along the centre line the camera is
  SE3 world_from_cam;
  bool is_narrow_band = false;  // the light
  InstrumentShape instrument;
  float blood_share = 0.0f;  // of the wall
};

}  // namespace haustra::render
