// Parameters of the depth of a keyframe. Plain data.
#pragma once

#include "hal/core/status.h"

namespace haustra {

struct DepthOptions {
  // Pixels from one cell to the next, [1, 8]: a quarter of the resolution.
  int step_px = 4;
  // The window is of (2 * radius + 1)^2 samples, so many pixels apart: [1, 5] and [1, 4]. Folds are narrow: on rendered
  // colons of 480x360 windows of 7 pixels have 2.3 % of error, of 13 pixels 2.5 %, of 26 pixels 3.6 %.
  int window_radius = 3;
  int window_step_px = 1;
  // Each spreads good planes by one cell and more and tries nearby ones, [1, 20].
  int num_iterations = 5;
  int max_sources = 6;  // [1, 12]
  // The cost is the mean over the sources that match best: a wall that a fold hides from half of them is still seen.
  int best_sources = 3;  // [1, max_sources]
  // Noise of the grey values, > 0. Windows whose contrast is of this size do not correlate.
  double noise_grey = 0.7;
  // Cost of a step to the cells that continue it, against the correlation of [-1, 1]; >= 0. With less a wall of little
  // texture falls apart, with more folds become lower than they are
  // (engine/surface/decisions/2026-11-27-others-look-past-the-edge.md).
  double smoothness = 0.25;
  // Relative step that costs all of it, > 0.
  double smooth_step = 0.03;
  // Less angle than this between the rays of reference and source says nothing, degrees, (0, 30).
  double min_parallax_deg = 1.0;

  // kInvalidArgument names the field.
  Status Validate() const;
};

}  // namespace haustra
