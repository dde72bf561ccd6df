// The Gaussian kernels between the levels of an octave, the same for every device.
#pragma once

#include "kernels/common/sift_parameters.h"

namespace haustra::kernels {

inline constexpr int kMaxKernelRadius = 16;

// Symmetric kernel: weights[0] at the centre, weights[j] at distance j; they sum up to 1.
struct GaussianKernel {
  int radius = 0;
  float weights[kMaxKernelRadius + 1] = {};
};

GaussianKernel MakeGaussianKernel(float sigma);

// The kernel that makes `level` from the level before; that of level 0: from the enlarged input.
GaussianKernel KernelOfLevel(int level);

// The kernel that makes level 0 of octave 0 from the input itself, where the enlarged picture is left out.
GaussianKernel KernelFromInput();

// Size of an octave of an image of the given size.
inline int OctaveSize(int size_px, int octave) { return octave < 0 ? size_px << -octave : size_px >> octave; }
int CountOctaves(int width_px, int height_px);
// Of an octave, the level nearest to a keypoint's scale; octave pixels.
int LevelOfScale(float scale);

}  // namespace haustra::kernels
