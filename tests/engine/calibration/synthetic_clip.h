// Windows of a clip through a folded tube, as a camera with known intrinsics would have followed its points.
#pragma once

#include <cmath>
#include <vector>

#include "engine/calibration/feature_window.h"
#include "engine/calibration/intrinsics.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "tests/geometry/synthetic.h"

namespace haustra::calibration {

struct SyntheticMotion {
  double forward = 0.8;    // over a window, in radii of the tube
  double sideways = 0.15;  // likewise, to and fro
  double turn_rad = 0.35;  // likewise
  double breathing = 0.0;  // share by which the wall narrows over a window
};

struct SyntheticCamera {
  Intrinsics intrinsics;
  int width_px = 0, height_px = 0;
};

inline SyntheticCamera ColonScope() { return {{398.0, 364.0, 266.0, -0.045, 0.006}, 720, 540}; }
// r = f tan(th), in the terms of Kannala-Brandt.
inline SyntheticCamera RigidScope() { return {{640.0, 362.0, 271.0, 1.0 / 3.0, 2.0 / 15.0}, 720, 540}; }

inline FeatureWindow MakeWindow(const SyntheticCamera& camera, const SyntheticMotion& motion, double noise_px,
                                Rng& rng) {
  constexpr int kViews = 10, kPoints = 250;
  FeatureWindow window;
  window.num_views = kViews;
  window.last_frame = kViews - 1;
  const Eigen::Vector3d turn_axis = test::RandomDirection(rng).cwiseProduct(Eigen::Vector3d(1.0, 1.0, 0.4));
  const double phase = rng.Uniform(0.0, 6.28), side = rng.Uniform(0.0, 6.28);
  std::vector<SE3> cam_from_world;
  for (int v = 0; v < kViews; ++v) {
    const double t = static_cast<double>(v) / (kViews - 1);
    const Eigen::Vector3d centre(0.2 * std::cos(side) + motion.sideways * std::sin(5.0 * t + phase),
                                 0.2 * std::sin(side) + motion.sideways * std::cos(4.0 * t + phase),
                                 motion.forward * t);
    const Eigen::Quaterniond rotation = ExpSO3(motion.turn_rad * t * turn_axis.normalized());
    cam_from_world.push_back(SE3(rotation, -(rotation * centre)));
  }
  for (int p = 0; p < kPoints; ++p) {
    const Eigen::Vector3d point = test::TubePoint(rng, 7.0);
    std::vector<TrackObservation> seen;
    for (int v = 0; v < kViews; ++v) {
      const double narrow = 1.0 - motion.breathing * v / (kViews - 1);
      Eigen::Vector2d pixel;
      const Eigen::Vector3d moved(narrow * point.x(), narrow * point.y(), point.z());
      if (!camera.intrinsics.Project(cam_from_world[v] * moved, &pixel, nullptr, nullptr)) continue;
      pixel += Eigen::Vector2d(noise_px * test::Gaussian(rng), noise_px * test::Gaussian(rng));
      if (pixel.x() < 0.0 || pixel.y() < 0.0 || pixel.x() > camera.width_px - 1 || pixel.y() > camera.height_px - 1) {
        continue;
      }
      // A twentieth of the features are somewhere else.
      if (rng.Uniform() < 0.05) pixel += Eigen::Vector2d(rng.Uniform(-30.0, 30.0), rng.Uniform(-30.0, 30.0));
      seen.push_back({v, static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 1.6f});
    }
    if (seen.size() < 3) continue;
    window.track_begins.push_back(static_cast<std::int32_t>(window.observations.size()));
    window.observations.insert(window.observations.end(), seen.begin(), seen.end());
  }
  window.track_begins.push_back(static_cast<std::int32_t>(window.observations.size()));
  return window;
}

inline std::vector<FeatureWindow> MakeClip(const SyntheticCamera& camera, const SyntheticMotion& motion,
                                           double noise_px, int num_windows, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<FeatureWindow> windows;
  for (int i = 0; i < num_windows; ++i) windows.push_back(MakeWindow(camera, motion, noise_px, rng));
  return windows;
}

}  // namespace haustra::calibration
