// The plan of a vision device for pictures of 320 x 240, with two feature sets: small, and quick to make.
#pragma once

#include "hal/vision_device.h"

namespace haustra::test {

inline VisionPlan SmallVisionPlan() {
  VisionPlan plan;
  plan.max_width_px = 320;
  plan.max_height_px = 240;
  plan.max_features = 500;
  plan.max_feature_sets = 2;
  plan.max_match_list = 100;
  return plan;
}

}  // namespace haustra::test
