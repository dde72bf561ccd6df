// Parameters of the depth that is searched while the scope moves. Plain data.
#pragma once

#include "hal/depth_options.h"

namespace haustra {

struct DepthConfig {
  // Costs memory for every keyframe (haustra plan) and a core or a share of the GPU.
  bool enabled = false;
  // Pixels from one cell to the next [1, 8]. 4, a quarter of the resolution, is for a GPU. A core takes 0.4 s a
  // keyframe at 8 and 480x360, longer than from one keyframe to the next of a moving scope: some have no depth then.
  int step_px = 4;
  int iterations = 5;   // of the search [1, 20]
  int max_sources = 6;  // keyframes that one is compared with [1, 12]
  // Of the newest keyframes, whole and grey, on the host [4, 200]. Older keyframes are not compared with.
  int kept_pictures = 24;
  // That come after one before its depth is searched [0, 100]: they show its wall from nearer and from the other side,
  // and a keyframe that is not needed is gone by then.
  int newer_keyframes = 6;

  DepthOptions options() const {
    DepthOptions options;
    options.step_px = step_px;
    options.num_iterations = iterations;
    options.max_sources = max_sources;
    options.best_sources = options.best_sources < max_sources ? options.best_sources : max_sources;
    return options;
  }
};

}  // namespace haustra
