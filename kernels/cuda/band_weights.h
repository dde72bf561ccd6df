// Gaussian blur as products of matrices, for tensor cores: 16 rows of a level are a band matrix times the rows of the
// source around them, and its columns likewise. All levels of an octave are made from one source at once, by the
// products of the kernels in between.
//
// Weights are multiples of 2^-16 that add up to exactly 1 and are exact as half-precision floats, so blur keeps a
// constant picture to the bit.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/common/gaussian_kernel.h"
#include "kernels/common/sift_parameters.h"

namespace haustra::kernels::cuda {

// What the levels of an octave are made from.
enum class BandSource {
  kEnlargedGrey,  // octave -1: the grey image, enlarged by two on the way
  kGrey,          // octave 0: the grey image
  kPlane,         // octaves 1 and up: level 0 of the octave
};
inline constexpr int kNumBandSources = 3;

// Source rows (or columns) that 16 of a level are made from, in steps of 16, the depth of a matrix product.
inline constexpr int BandSteps(BandSource source) { return source == BandSource::kEnlargedGrey ? 2 : 3; }
inline constexpr int kMaxBandSteps = 3;
// The source row of the first weight of row 0, counted from the source row at row 0's place. At most 4.8 standard
// deviations of the blur for kEnlargedGrey, at least 3.2 for the others.
inline constexpr int BandMargin(BandSource source) { return source == BandSource::kEnlargedGrey ? 12 : 16; }

// Fragments of `mma.m16n8k16` as a lane loads them: half-precision weights times kBandScale, two to a word.
// (2^15: a weight of 1 is exact, and so is one of 2^-16.)
inline constexpr float kBandScale = 32768.0f;
struct BandFragment {
  std::uint32_t words[4];
};
struct BandWeights {
  // The band matrix from the left, 16 rows of the level by 16 source rows a step.
  BandFragment rows[kNumLevels][kMaxBandSteps][32];
  // Its transpose from the right: words 0 and 1 give columns 0 to 7 of the level, words 2 and 3 columns 8 to 15.
  BandFragment columns[kNumLevels][kMaxBandSteps][32];
};

BandWeights MakeBandWeights(BandSource source);

// Weight of source row `source_row` (from the first that the band reads) for row `row` of the level, in units of
// 2^-16. For tests.
int BandWeight(BandSource source, int level, int row, int source_row);

// Blur before every second (factor 2) or fourth pixel is taken: makes level 0 of an octave from level 0 of the one or
// two finer ones, or level 0 of octave 1 or 2 from the grey image. Symmetric weights up to ReductionRadius.
inline constexpr int ReductionRadius(int factor) { return 8 * factor - 1; }
std::vector<float> WeightsOfReduction(int factor, bool from_grey);

}  // namespace haustra::kernels::cuda
