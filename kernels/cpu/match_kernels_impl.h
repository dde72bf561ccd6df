// The inner loops of matching; included by one source file for each SIMD level and nowhere else. The including file
// defines, before it includes this one, with internal linkage in haustra::kernels:
//   void DotTile(const std::uint8_t* queries, const std::uint8_t* train_block, const std::int32_t* train_sums,
//                std::int32_t dots[kQueryTile][kTrainBlock]);
//   std::int32_t Dot(const std::uint8_t* a, const std::uint8_t* b);
// Must be compiled with -ffp-contract=off. Internal linkage throughout (see simd_vector.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "kernels/cpu/match_kernels.h"
#include "kernels/cpu/simd_vector.h"

namespace haustra::kernels {
namespace {

constexpr int kVectors = kTrainBlock / kLanes;

// -1 in the lanes whose keypoints are admissible with the query.
inline VecI Admissible(const GatePoint& query, const GateBlock& train, const GateOptions& gate, int first_lane) {
  VecI mask = SplatInt(-1);
  if (gate.has_window) {
    mask &= Abs(Load(train.x_px + first_lane) - query.x_px) <= gate.max_dx_px;
    mask &= Abs(Load(train.y_px + first_lane) - query.y_px) <= gate.max_dy_px;
  }
  if (gate.has_epipolar) {
    const VecF to_plane_of_query = Load(train.bearing[0] + first_lane) * query.epipolar[0] +
                                   Load(train.bearing[1] + first_lane) * query.epipolar[1] +
                                   Load(train.bearing[2] + first_lane) * query.epipolar[2];
    const VecF to_plane_of_train = Load(train.epipolar[0] + first_lane) * query.bearing[0] +
                                   Load(train.epipolar[1] + first_lane) * query.bearing[1] +
                                   Load(train.epipolar[2] + first_lane) * query.bearing[2];
    mask &= Abs(to_plane_of_query) <= Load(train.tolerance + first_lane);
    mask &= Abs(to_plane_of_train) <= query.tolerance;
  }
  return mask;
}

struct LaneTwoNearest {
  alignas(64) float best[kTrainBlock];
  alignas(64) float second[kTrainBlock];
  alignas(64) std::int32_t best_idx[kTrainBlock];
};

inline TwoNearest Reduce(const LaneTwoNearest& lanes) {
  TwoNearest top;
  for (int i = 0; i < kTrainBlock; ++i) {
    const float best = lanes.best[i];
    const bool is_better = best > top.best || (best == top.best && best >= 0.0f && lanes.best_idx[i] < top.best_idx);
    if (is_better) {
      top.second = top.best > lanes.second[i] ? top.best : lanes.second[i];
      top.best = best;
      top.best_idx = lanes.best_idx[i];
    } else if (best > top.second) {
      top.second = best;
    }
  }
  return top;
}

void MatchQueries(const QueryList& queries, int begin, int end, const TrainBlocks& train, const GateOptions& gate,
                  TwoNearest* results, const TrainBest& train_best) {
  const bool has_gate = train.gates != nullptr;
  alignas(64) std::int32_t lane_numbers[kTrainBlock];
  for (int i = 0; i < kTrainBlock; ++i) lane_numbers[i] = i;
  const VecF none = Splat(-1.0f);
  for (int tile = begin; tile < end; tile += kQueryTile) {
    const int num_queries = end - tile < kQueryTile ? end - tile : kQueryTile;
    LaneTwoNearest tops[kQueryTile];
    for (LaneTwoNearest& top : tops) {
      for (int i = 0; i < kTrainBlock; ++i) {
        top.best[i] = -1.0f;
        top.second[i] = -1.0f;
        top.best_idx[i] = -1;
      }
    }
    for (int b = 0; b < train.num_blocks; ++b) {
      alignas(64) std::int32_t dots[kQueryTile][kTrainBlock];
      DotTile(queries.descriptors + static_cast<std::ptrdiff_t>(tile) * kDescriptorBytes,
              train.bytes + static_cast<std::ptrdiff_t>(b) * kTrainBlockBytes, train.sums + b * kTrainBlock, dots);
      for (int q = 0; q < num_queries; ++q) {
        const int query = tile + q;
        if (!queries.is_valid[query]) continue;
        LaneTwoNearest& top = tops[q];
        for (int v = 0; v < kVectors; ++v) {
          const int lane = v * kLanes;
          const int train_lane = b * kTrainBlock + lane;
          VecI admissible = LoadInts(train.is_valid + train_lane);
          if (has_gate) {
            admissible &= Admissible(queries.gates[query], train.gates[b], gate, lane);
            if (MaskBits(admissible) == 0) continue;
          }
          const VecF weight = Load(train.inverse_norms + train_lane) * queries.inverse_norms[query];
          const VecF similarity = Select(admissible, ToFloat(LoadInts(dots[q] + lane)) * weight, none);
          const VecF best = Load(top.best + lane);
          const VecI is_better = similarity > best;
          Store(top.second + lane, Max(Load(top.second + lane), Min(best, similarity)));
          Store(top.best + lane, Max(best, similarity));
          StoreInts(top.best_idx + lane, SelectInt(is_better, LoadInts(lane_numbers + lane) + b * kTrainBlock,
                                                   LoadInts(top.best_idx + lane)));
          if (train_best.similarity != nullptr) {
            const VecF before = Load(train_best.similarity + train_lane);
            Store(train_best.similarity + train_lane, Max(before, similarity));
            StoreInts(train_best.query + train_lane,
                      SelectInt(similarity > before, SplatInt(query), LoadInts(train_best.query + train_lane)));
          }
        }
      }
    }
    for (int q = 0; q < num_queries; ++q) results[tile + q] = Reduce(tops[q]);
  }
}

constexpr MatchKernels kKernels = {MatchQueries, Dot};

}  // namespace
}  // namespace haustra::kernels
