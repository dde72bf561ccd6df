// How many matches of two pictures one rigid motion explains, and which: what features are worth where nobody knows the
// true motion. The geometry is the engine's (engine/geometry/two_view.h), the noise that of founding
// (initialisation.noise_k, noise_sigma_0_px). For benchmarks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/config.h"
#include "engine/geometry/two_view.h"
#include "hal/vision_device.h"

namespace haustra::benchmarks {

struct PairFigures {
  static constexpr int kOctaves = 6;  // -1 to 3, then all coarser ones

  int matches = 0;
  int inliers = 0;
  int places = 0;  // inliers at different pixels of both pictures: a second orientation is no second place
  int parts = 0;   // of 12 x 9 parts of the picture with an inlier
  // Matches that stand still by their own noise while the middle inlier moves by many times that: painted on the lens
  // or into the picture, or far away.
  int still = 0;
  double middle_motion_px = 0.0;  // of the inliers
  std::array<int, kOctaves> inliers_of_octave{};
};

// thread-bound(its owner); the same answer for the same pair, whatever was judged before.
class PairJudge {
 public:
  PairJudge(const EngineConfig& config, int width_px, int height_px, double focal_px);

  // Matches between features of a (query) and b (train). A motion with depth, or a rotation, whichever explains more.
  PairFigures Judge(const FrameFeatures& a, const FrameFeatures& b, std::span<const Match> matches);

 private:
  const EngineConfig& config_;
  int width_px_, height_px_;
  double focal_px_;
  TwoViewRansac ransac_;
  std::vector<Eigen::Vector3d> bearings_a_, bearings_b_;
  std::vector<double> tolerance_, residual_, motion_;
  std::vector<std::uint8_t> flags_, of_rotation_;
};

}  // namespace haustra::benchmarks
