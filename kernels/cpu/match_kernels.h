// The inner loops of matching, one table for each SIMD level. All levels give the same results to the bit: products are
// exact integers, and the few float operations on them are the same, in the same order, without contraction.
#pragma once

#include <array>
#include <cstdint>

#include "hal/vision_device.h"
#include "kernels/cpu/simd_level.h"

namespace haustra::kernels {

// Train descriptors come in blocks of 16, interleaved by groups of four bytes: [group 0..31][descriptor 0..15][4
// bytes].
inline constexpr int kTrainBlock = 16;
inline constexpr int kTrainBlockBytes = kTrainBlock * kDescriptorBytes;
// Queries are taken this many at a time.
inline constexpr int kQueryTile = 8;

// What to know of one keypoint for the gates.
struct GatePoint {
  float x_px = 0.0f;
  float y_px = 0.0f;
  std::array<float, 3> bearing{};
  std::array<float, 3> epipolar{};  // unit normal of the epipolar plane that the keypoint spans in the other image
  float tolerance = 0.0f;
};

// The same for a block of train keypoints.
struct GateBlock {
  alignas(64) float x_px[kTrainBlock];
  alignas(64) float y_px[kTrainBlock];
  alignas(64) float bearing[3][kTrainBlock];
  alignas(64) float epipolar[3][kTrainBlock];
  alignas(64) float tolerance[kTrainBlock];
};

struct TrainBlocks {
  int num_blocks = 0;
  const std::uint8_t* bytes = nullptr;     // kTrainBlockBytes a block
  const std::int32_t* sums = nullptr;      // of the bytes of each descriptor
  const float* inverse_norms = nullptr;    // of each descriptor
  const std::int32_t* is_valid = nullptr;  // -1: may match; 0: stale, or filler at the end
  const GateBlock* gates = nullptr;        // one a block; nullptr: no gate
};

struct QueryList {
  const std::uint8_t* descriptors = nullptr;  // N x 128, readable up to a whole tile
  const float* inverse_norms = nullptr;
  const std::uint8_t* is_valid = nullptr;
  const GatePoint* gates = nullptr;
};

struct GateOptions {
  bool has_window = false;
  float max_dx_px = 0.0f;
  float max_dy_px = 0.0f;
  bool has_epipolar = false;
};

// Best and second best train descriptor of a query; -1: none admissible. Ties go to the lower index.
struct TwoNearest {
  float best = -1.0f;
  float second = -1.0f;
  std::int32_t best_idx = -1;
};

// Best query of each train descriptor, in lanes of the blocks.
struct TrainBest {
  float* similarity = nullptr;  // -1: none
  std::int32_t* query = nullptr;
};

struct MatchKernels {
  // Queries [begin, end) against all train blocks; results[i] for query i. Similarity of a pair:
  // float(product) * (inverse norm of the query * inverse norm of the train descriptor).
  // `train_best` (optional: similarity == nullptr) is updated with the queries in ascending order.
  void (*MatchQueries)(const QueryList& queries, int begin, int end, const TrainBlocks& train, const GateOptions& gate,
                       TwoNearest* results, const TrainBest& train_best);
  // Exact product of two descriptors of 128 bytes.
  std::int32_t (*Dot)(const std::uint8_t* a, const std::uint8_t* b);
};

// The level must be supported (simd_level.h).
const MatchKernels& MatchKernelsFor(SimdLevel level);

}  // namespace haustra::kernels
