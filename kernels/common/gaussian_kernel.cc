#include "kernels/common/gaussian_kernel.h"

#include <algorithm>
#include <cmath>

namespace haustra::kernels {

GaussianKernel MakeGaussianKernel(float sigma) {
  GaussianKernel kernel;
  kernel.radius = std::clamp(static_cast<int>(std::ceil(kKernelRadiusSigmas * sigma)), 1, kMaxKernelRadius);
  double sum = 0.0;
  for (int j = 0; j <= kernel.radius; ++j) {
    const double weight = std::exp(-0.5 * j * j / (static_cast<double>(sigma) * sigma));
    kernel.weights[j] = static_cast<float>(weight);
    sum += j == 0 ? weight : 2 * weight;
  }
  for (int j = 0; j <= kernel.radius; ++j) kernel.weights[j] = static_cast<float>(kernel.weights[j] / sum);
  return kernel;
}

GaussianKernel KernelOfLevel(int level) {
  if (level == 0) {
    const float input_sigma = std::ldexp(kInputSigma, -kFirstOctave);
    return MakeGaussianKernel(std::sqrt(kBaseSigma * kBaseSigma - input_sigma * input_sigma));
  }
  const float factor = std::exp2(1.0f / kScalesPerOctave);
  const float before = kBaseSigma * std::pow(factor, static_cast<float>(level - 1));
  return MakeGaussianKernel(before * std::sqrt(factor * factor - 1.0f));
}

GaussianKernel KernelFromInput() {
  // Enlarging by linear interpolation is a blur of its own: weights 1/4, 1/2, 1/4 half a pixel apart.
  constexpr float kVarianceOfEnlarging = 2 * 0.25f * 0.5f * 0.5f;
  return MakeGaussianKernel(std::sqrt(kBaseSigma * kBaseSigma - kInputSigma * kInputSigma + kVarianceOfEnlarging));
}

int LevelOfScale(float scale) {
  const long level = std::lround(kScalesPerOctave * std::log2(scale / kBaseSigma));
  return static_cast<int>(std::clamp(level, 1L, static_cast<long>(kScalesPerOctave)));
}

int CountOctaves(int width_px, int height_px) {
  int count = 0;
  while (count < kMaxOctaves - kFirstOctave &&
         OctaveSize(std::min(width_px, height_px), kFirstOctave + count) >= kMinOctaveSizePx) {
    ++count;
  }
  return count;
}

}  // namespace haustra::kernels
