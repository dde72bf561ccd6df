// Standard deviation of an observation by the SIFT scale of its keypoint: sigma = k * scale + sigma_0 (paper, Section
// III-F). Every gate, search radius and robust kernel of the engine is chi-square on it. Starts from the configured
// prior and follows what tracking/noise_meter.h measures. Plain data; its owner passes it between threads by copy.
#pragma once

#include "engine/config.h"

namespace haustra {

struct NoiseModel {
  NoiseModel() = default;
  explicit NoiseModel(const NoiseConfig& prior) : k(prior.k), sigma_0_px(prior.sigma_0_px) {}
  double SigmaPx(double scale_px) const { return k * scale_px + sigma_0_px; }

  double k = 0.0;           // px per px of scale
  double sigma_0_px = 1.0;  // of each coordinate
};

}  // namespace haustra
