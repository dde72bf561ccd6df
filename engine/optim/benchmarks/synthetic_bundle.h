// A window of a synthetic colon for benchmarks and tests of bundle adjustment: cameras on a gently winding path through
// a tube, points on its wall, each seen by consecutive cameras. Everything follows from the seed.
#pragma once

#include <cstdint>

#include "engine/camera/camera_model.h"
#include "engine/optim/bundle_adjustment.h"

namespace haustra {

struct SyntheticBundleOptions {
  int num_poses = 20;
  int num_points = 4000;
  double mean_track_length = 6.8;   // observations of a point
  int num_fixed_poses = 2;          // the first ones
  double pixel_noise_sigmas = 1.0;  // standard deviation of the pixel noise in units of each observation's sigma
  double outlier_share = 0.0;       // observations moved 20 to 80 px off in a random direction
  double pose_noise_rad = 0.01;     // start values of free poses: rotation, and translation in tube radii
  double point_noise_radii = 0.03;  // start values of points, in tube radii
  std::uint64_t seed = 1;
};

struct SyntheticBundle {
  CameraModel camera;   // Kannala-Brandt, 720x540, 150 degrees across
  BundleProblem truth;  // noise-free poses and points; the pixels are those of `start`; is_outlier is what was made
  BundleProblem start;  // what an optimiser is given
};

// The camera alone.
CameraModel SyntheticEndoscope();
SyntheticBundle MakeSyntheticBundle(const SyntheticBundleOptions& options);

}  // namespace haustra
