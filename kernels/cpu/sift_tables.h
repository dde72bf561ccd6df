// Fixed sampling grid and weights of the descriptor; computed once, read-only afterwards.
#pragma once

#include "kernels/common/sift_parameters.h"

namespace haustra::kernels {

// Samples row by row; u to the right and v down, in spacings from the centre. Filled up to whole vectors with samples
// of weight 0. A row (or column) of samples lies between the centres of two cells, counting one cell more on either
// side than the descriptor has (those collect what falls outside, and are dropped).
struct DescriptorTables {
  static constexpr int kSide = (kDescriptorCells + 1) * kDescriptorSamplesPerCell;
  static constexpr int kNumSamples = kSide * kSide;
  static constexpr int kPaddedSize = (kNumSamples + 15) / 16 * 16;

  alignas(64) float u[kPaddedSize];
  alignas(64) float v[kPaddedSize];
  alignas(64) float weights[kPaddedSize];  // Gaussian
  // Linear weight of the cell before and after, the same for rows and columns.
  float before_weight[kSide];
  float after_weight[kSide];
};

const DescriptorTables& GetDescriptorTables();

}  // namespace haustra::kernels
