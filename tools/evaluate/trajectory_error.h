// Absolute trajectory error of poses with a frame of reference and a scale of their own. reentrant.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "engine/geometry/sim3.h"

namespace haustra::evaluate {

// Fewer frames than this say too little: with a Sim(3) of its own such a map fits nearly anything.
inline constexpr std::size_t kMinAteFrames = 10;

// One frame twice: as estimated (map frame, map units) and as it truly was (ground-truth units). Poses: world_from_cam.
struct PosePair {
  SE3 estimated;
  SE3 truth;
};

struct Alignment {
  Sim3 truth_from_map;
  double squared_error = 0.0;  // summed over the frames
  double max_error = 0.0;
  std::size_t count = 0;
  double rms() const;
};

// The Sim(3) that brings the camera centres nearest to the true ones (Umeyama 1991), and what error it leaves.
// Nothing for fewer than `min_frames`, and when the centres lie on one line (their Sim(3) is not unique).
std::optional<Alignment> Align(std::span<const PosePair> poses, std::size_t min_frames = kMinAteFrames);

// Scale of the last quarter over that of the first, each aligned on its own; `poses` in order of time. Nothing when a
// quarter has fewer than 5 frames or cannot be aligned.
std::optional<double> FindScaleDrift(std::span<const PosePair> poses);

}  // namespace haustra::evaluate
