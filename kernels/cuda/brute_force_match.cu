// Brute-force matching: blocks of 128 queries against tiles of 128 train descriptors, products by integer tensor cores
// or dp4a, best and second best kept in registers. A second dimension of the grid shares out the tiles; the last block
// of each query tile joins and judges the results. Whose best is whose is looked up by a second kernel.
#include <algorithm>
#include <cstdint>

#include "kernels/cuda/best_two.cuh"
#include "kernels/cuda/kernel_launch.cuh"
#include "kernels/cuda/match_common.cuh"
#include "kernels/cuda/match_kernels.h"
#include "kernels/cuda/match_tile.cuh"

namespace haustra::kernels::cuda {
namespace {

constexpr int kQueryTile = kMatchTile;
constexpr int kThreads = 256;
constexpr int kStages = 3;
constexpr int kTileBytes = kTrainTile * kDescriptorBytes;

// Layout of the dynamic shared memory.
struct SharedLayout {
  static constexpr int kTrain = 0;
  static constexpr int kTrainNorms = kTrain + kStages * kTileBytes;
  static constexpr int kQueryNorms = kTrainNorms + kStages * kTrainTile * 4;
  static constexpr int kColumnBest = kQueryNorms + kQueryTile * 4;
  static constexpr int kQueryGates = kColumnBest + kTrainTile * 8;
  static constexpr int kJoin = kQueryGates + kGateValues * kQueryTile * 4;
  static constexpr int kQueries = (kJoin + kQueryTile * 16 + 1023) / 1024 * 1024;
  static constexpr int kSize = kQueries + kQueryTile * kDescriptorBytes;
  // Where the queries were, when all warps have them in registers.
  static constexpr int kSlots = kQueries;
  static_assert(kThreads * kSlotFloats * 4 <= kQueryTile * kDescriptorBytes);
};

__device__ __forceinline__ std::int32_t RowAt(const RowList& list, int i) {
  return list.rows != nullptr ? list.rows[i] : list.first + i;
}

// Whether a pair passes the gates; the same operations as the CPU device's, without contraction.
__device__ bool IsAdmissible(const float* query, const GateArrays& train, int train_idx, const GateInput& gate) {
  const auto q = [&](int k) { return query[k * kQueryTile]; };
  const auto t = [&](int k) { return __ldg(train.values + static_cast<std::size_t>(k) * train.capacity + train_idx); };
  if (gate.has_window &&
      !(fabsf(__fsub_rn(t(0), q(0))) <= gate.max_dx_px && fabsf(__fsub_rn(t(1), q(1))) <= gate.max_dy_px)) {
    return false;
  }
  if (gate.query_bearings == nullptr) return true;
  const float to_plane_of_query =
      __fadd_rn(__fadd_rn(__fmul_rn(t(2), q(5)), __fmul_rn(t(3), q(6))), __fmul_rn(t(4), q(7)));
  const float to_plane_of_train =
      __fadd_rn(__fadd_rn(__fmul_rn(t(5), q(2)), __fmul_rn(t(6), q(3))), __fmul_rn(t(7), q(4)));
  return fabsf(to_plane_of_query) <= t(8) && fabsf(to_plane_of_train) <= q(8);
}

// Best query of a train descriptor as one number: similarity, at least 0, first, then the lower query.
__device__ __forceinline__ unsigned long long ColumnKey(float similarity, int query) {
  return static_cast<unsigned long long>(__float_as_uint(similarity)) << 32 |
         (0xffffffffu - static_cast<std::uint32_t>(query));
}

// The results of a tile to the host, a query to a thread; threads beyond have a rejected one. By all threads of a
// block. Fewer bytes take less time, most of all to read on the host. Each is written at once, with its mark: nothing
// has to wait until host memory has it, which takes 2 us.
__device__ void WriteResults(const MatchJob& job, int tile, TwoNearest top) {
  constexpr int kWarps = kMatchTile / 32;
  __shared__ int counts[kWarps];
  const int thread = threadIdx.x;
  const int warp = thread / 32;
  const bool is_kept = top.state != kRejected;
  const std::uint32_t kept = __ballot_sync(0xffffffffu, is_kept);
  if (thread < kMatchTile && thread % 32 == 0) counts[warp] = __popc(kept);
  __syncthreads();
  int place = __popc(kept & ((1u << thread % 32) - 1));
  int num_kept = 0;
#pragma unroll
  for (int w = 0; w < kWarps; ++w) {
    if (w < warp) place += counts[w];
    num_kept += counts[w];
  }
  const int first_query = tile * kMatchTile;
  const std::uint32_t mark = job.mark << kMarkShift;
  if (is_kept) {
    *reinterpret_cast<int4*>(job.results + first_query + place) = {
        __float_as_int(top.best), __float_as_int(top.second), top.best_idx,
        static_cast<std::int32_t>(mark | thread << kQueryShift | top.state)};
  }
  if (thread == 0 && num_kept < min(kMatchTile, job.query.size - first_query)) {
    job.results[first_query + num_kept].state = static_cast<std::int32_t>(mark | kRejected);
  }
}

// What one launch does: some of the query tiles, each against the tiles of the train list, those shared out in splits.
struct MatchSlice {
  int first_query_tile;
  int tiles_per_split;
};

template <DotProduct kDot, bool kGated, bool kMutual>
__global__ void __launch_bounds__(kThreads, 2)
    BruteForceKernel(const __grid_constant__ MatchJob job, const __grid_constant__ SetBuffers sets,
                     const __grid_constant__ MatchWork work, const MatchSlice slice) {
  extern __shared__ __align__(1024) std::uint8_t shared[];
  const std::uint32_t base = SharedAddress(shared);
  float* query_norms = reinterpret_cast<float*>(shared + SharedLayout::kQueryNorms);
  unsigned long long* column_best = reinterpret_cast<unsigned long long*>(shared + SharedLayout::kColumnBest);
  float* query_gates = reinterpret_cast<float*>(shared + SharedLayout::kQueryGates);
  TwoNearest* join = reinterpret_cast<TwoNearest*>(shared + SharedLayout::kJoin);

  WaitForKernelBefore();
  const int thread = threadIdx.x;
  const int lane = thread % 32;
  const int warp_row = thread / 32 / 2;     // 32 queries
  const int warp_column = thread / 32 % 2;  // 64 train descriptors
  constexpr bool kPlain = kDot == DotProduct::kTensorCores && !kGated && !kMutual;
  // Instances for all requests look at what is asked for; the others know.
  const bool is_gated = kGated && job.is_gated;
  const bool is_mutual = kMutual && job.options.mutual;
  const int query_tile = slice.first_query_tile + blockIdx.x;
  const int first_query = query_tile * kQueryTile;
  const int num_tiles = (job.train.size + kTrainTile - 1) / kTrainTile;
  const int first_tile = blockIdx.y * slice.tiles_per_split;
  const int last_tile = min(num_tiles, first_tile + slice.tiles_per_split);

  // Invalid entries read row 0; their norm is -1, which no query has, or below all, which is no train descriptor's.
  constexpr int query_base = SharedLayout::kQueries;
  for (int i = thread; i < kQueryTile * 8; i += kThreads) {
    const int query = first_query + i / 8;
    const std::int32_t row = query < job.query.size ? RowAt(job.query, query) : -1;
    CopyAsync16(base + query_base + Swizzled(i / 8, i % 8),
                sets.descriptors + static_cast<std::size_t>(max(row, 0)) * kDescriptorBytes + i % 8 * 16);
  }
  const auto load_norm = [&](float* to, std::int32_t row, float otherwise) {
    if (row >= 0) {
      CopyAsync4(SharedAddress(to), sets.inverse_norms + row);
    } else {
      *to = otherwise;
    }
  };
  if (thread < kQueryTile) {
    const int query = first_query + thread;
    load_norm(query_norms + thread, query < job.query.size ? RowAt(job.query, query) : -1, -1.0f);
  }
  CommitCopies();
  if (is_gated) {
    for (int i = thread; i < kGateValues * kQueryTile; i += kThreads) {
      const int query = first_query + i % kQueryTile;
      query_gates[i] =
          query < job.query.size
              ? work.query_gates.values[static_cast<std::size_t>(i / kQueryTile) * work.query_gates.capacity + query]
              : 0.0f;
    }
  }
  const auto load_tile = [&](int tile, int stage) {
    if (tile < last_tile) {
      float* norms = reinterpret_cast<float*>(shared + SharedLayout::kTrainNorms) + stage * kTrainTile;
#pragma unroll
      for (int i = thread; i < kTrainTile * 8; i += kThreads) {
        const int train = tile * kTrainTile + i / 8;
        const std::int32_t row = train < job.train.size ? RowAt(job.train, train) : -1;
        CopyAsync16(base + SharedLayout::kTrain + stage * kTileBytes + Swizzled(i / 8, i % 8),
                    sets.descriptors + static_cast<std::size_t>(max(row, 0)) * kDescriptorBytes + i % 8 * 16);
      }
      const int i = thread - (kThreads - kTrainTile);
      if (i >= 0) {
        const int train = tile * kTrainTile + i;
        load_norm(norms + i, train < job.train.size ? RowAt(job.train, train) : -1, -INFINITY);
      }
    }
    CommitCopies();
  };
#pragma unroll
  for (int s = 0; s < kStages - 1; ++s) load_tile(first_tile + s, s);

  WaitForCopies<kStages - 1>();  // the queries; the train tiles may still be on their way
  __syncthreads();
  std::uint32_t a[2][4][4];
  if constexpr (kDot == DotProduct::kTensorCores) {
#pragma unroll
    for (int m = 0; m < 2; ++m) {
#pragma unroll
      for (int k = 0; k < 4; ++k) {
        LoadMatrices(a[m][k], base + query_base + Swizzled(warp_row * 32 + m * 16 + lane % 16, 2 * k + lane / 16));
      }
    }
  }

  const float* norms_of_warp = query_norms + warp_row * 32;
  TwoNearest row_top;  // plain: of row `lane` of the warp's 32
  TwoNearest tops[4];  // otherwise: of rows 8 * r + lane / 4
  float norms_of_rows[4];
  // Nothing gets past this; never looked at.
  if (norms_of_warp[lane] < 0.0f) row_top.second = 2.0f;
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    norms_of_rows[r] = norms_of_warp[8 * r + lane / 4];
    if (norms_of_rows[r] < 0.0f) tops[r].second = 2.0f;
  }

  int stage = 0;
  for (int tile = first_tile; tile < last_tile; ++tile) {
    WaitForCopies<kStages - 2>();
    if (is_mutual) {
      if (thread < kTrainTile) column_best[thread] = 0;
    }
    __syncthreads();
    load_tile(tile + kStages - 1, (stage + kStages - 1) % kStages);
    const int train_base = SharedLayout::kTrain + stage * kTileBytes;
    const float* train_norms = reinterpret_cast<const float*>(shared + SharedLayout::kTrainNorms) + stage * kTrainTile;
    stage = (stage + 1) % kStages;
    if constexpr (kPlain) {
      float* slots = reinterpret_cast<float*>(shared + SharedLayout::kSlots) + thread / 32 * 32 * kSlotFloats;
      const int columns = warp_column * 64;
      if (tile == first_tile) {
        // Nearly all may enter here, so both parts do at once.
        float values[2][4][8];
#pragma unroll
        for (int part = 0; part < 2; ++part) {
          int sums[2][4][4];
          MultiplyPart(a, base + train_base, columns + part * 32, sums);
          FindSimilarities(sums, norms_of_warp, train_norms + columns + part * 32, values[part]);
        }
        Enter(values, tile * kTrainTile + columns, slots, row_top);
        continue;
      }
#pragma unroll
      for (int part = 0; part < 2; ++part) {
        const int first_column = columns + part * 32;
        int sums[2][4][4];
        MultiplyPart(a, base + train_base, first_column, sums);
        if (!MayEnter(sums, norms_of_warp, train_norms + first_column, row_top)) continue;
        float values[1][4][8];
        FindSimilarities(sums, norms_of_warp, train_norms + first_column, values[0]);
        Enter(values, tile * kTrainTile + first_column, slots, row_top);
      }
    } else {
#pragma unroll
      for (int part = 0; part < 2; ++part) {
        const int first_column = warp_column * 64 + part * 32;
        int sums[2][4][4];
        if constexpr (kDot == DotProduct::kTensorCores) {
          MultiplyPart(a, base + train_base, first_column, sums);
        } else {
          BeginSums(sums);
#pragma unroll 1
          for (int piece = 0; piece < 8; ++piece) {
            uint4 q[4];
#pragma unroll
            for (int r = 0; r < 4; ++r) {
              q[r] = *reinterpret_cast<const uint4*>(shared + query_base +
                                                     Swizzled(warp_row * 32 + 8 * r + lane / 4, piece));
            }
#pragma unroll
            for (int n = 0; n < 4; ++n) {
#pragma unroll
              for (int e = 0; e < 2; ++e) {
                const uint4 t = *reinterpret_cast<const uint4*>(
                    shared + train_base + Swizzled(first_column + 8 * n + lane % 4 * 2 + e, piece));
#pragma unroll
                for (int r = 0; r < 4; ++r) {
                  std::uint32_t sum = static_cast<std::uint32_t>(sums[r / 2][n][r % 2 * 2 + e]);
                  sum = __dp4a(q[r].x, t.x, sum);
                  sum = __dp4a(q[r].y, t.y, sum);
                  sum = __dp4a(q[r].z, t.z, sum);
                  sum = __dp4a(q[r].w, t.w, sum);
                  sums[r / 2][n][r % 2 * 2 + e] = static_cast<int>(sum);
                }
              }
            }
          }
        }

        float similarity[4][8];
#pragma unroll
        for (int n = 0; n < 4; ++n) {
#pragma unroll
          for (int e = 0; e < 2; ++e) {
            const int column = first_column + 8 * n + lane % 4 * 2 + e;
            const float norm = train_norms[column];
#pragma unroll
            for (int r = 0; r < 4; ++r) {
              const float product = __int_as_float(sums[r / 2][n][r % 2 * 2 + e]) - __int_as_float(kFloatBase);
              float value = __fmul_rn(product, __fmul_rn(norm, norms_of_rows[r]));
              value = norm >= 0.0f ? value : -1.0f;
              if (is_gated) {
                const int train = tile * kTrainTile + column;
                if (train < job.train.size &&
                    !IsAdmissible(query_gates + warp_row * 32 + 8 * r + lane / 4, work.train_gates, train, job.gate)) {
                  value = -1.0f;
                }
              }
              similarity[r][2 * n + e] = value;
            }
          }
        }
#pragma unroll
        for (int r = 0; r < 4; ++r) {
          float highest = similarity[r][0];
#pragma unroll
          for (int c = 1; c < 8; ++c) highest = fmaxf(highest, similarity[r][c]);
          if (highest <= tops[r].second) continue;
#pragma unroll
          for (int c = 0; c < 8; ++c) {
            const float value = similarity[r][c];
            tops[r].second = fmaxf(tops[r].second, fminf(tops[r].best, value));
            if (value > tops[r].best) {
              tops[r].best = value;
              tops[r].best_idx = tile * kTrainTile + first_column + 8 * (c / 2) + lane % 4 * 2 + c % 2;
            }
          }
        }
        if (is_mutual) {
#pragma unroll
          for (int c = 0; c < 8; ++c) {
            // The highest similarity first, then the first query that has it: half of the work of keys of 64 bits.
            float values[4];
            float highest = -1.0f;
#pragma unroll
            for (int r = 0; r < 4; ++r) {
              // Invalid queries have a norm below 0.
              values[r] = norms_of_rows[r] >= 0.0f ? similarity[r][c] : -1.0f;
              highest = fmaxf(highest, values[r]);
            }
#pragma unroll
            for (int step = 4; step < 32; step *= 2) {
              highest = fmaxf(highest, __shfl_xor_sync(0xffffffffu, highest, step));
            }
            int row = 32;
#pragma unroll
            for (int r = 3; r >= 0; --r) {
              if (values[r] == highest) row = 8 * r + lane / 4;
            }
#pragma unroll
            for (int step = 4; step < 32; step *= 2) row = min(row, __shfl_xor_sync(0xffffffffu, row, step));
            if (lane < 4 && highest >= 0.0f) {
              atomicMax(&column_best[first_column + 8 * (c / 2) + lane % 4 * 2 + c % 2],
                        ColumnKey(highest, first_query + warp_row * 32 + row));
            }
          }
        }
      }
      if (is_mutual) {
        __syncthreads();
        const int train = tile * kTrainTile + thread;
        if (thread < kTrainTile && train < job.train.size && column_best[thread] != 0) {
          atomicMax(&work.train_best[train], column_best[thread]);
        }
        __syncthreads();
      }
    }
  }
  WaitForCopies<0>();

  // Four lanes of a row, then the two warps of a row.
  TwoNearest* rows = join + warp_row * 32;
  if constexpr (kPlain) {
    if (warp_column == 1) rows[lane] = row_top;
  } else {
#pragma unroll
    for (int r = 0; r < 4; ++r) {
#pragma unroll
      for (int step = 1; step < 4; step *= 2) {
        const float best = __shfl_xor_sync(0xffffffffu, tops[r].best, step);
        const float second = __shfl_xor_sync(0xffffffffu, tops[r].second, step);
        const std::int32_t best_idx = __shfl_xor_sync(0xffffffffu, tops[r].best_idx, step);
        Join(tops[r], best, second, best_idx);
      }
      if (warp_column == 1 && lane % 4 == 0) rows[8 * r + lane / 4] = tops[r];
    }
  }
  __syncthreads();
  const int padded_queries = gridDim.x * kQueryTile;
  const auto hand_over = [&](int row, TwoNearest top) {
    Join(top, rows[row].best, rows[row].second, rows[row].best_idx);
    work.partial[static_cast<std::size_t>(blockIdx.y) * padded_queries + blockIdx.x * kQueryTile + warp_row * 32 +
                 row] = top;
  };
  if (warp_column == 0) {
    if constexpr (kPlain) {
      hand_over(lane, row_top);
    } else if (lane % 4 == 0) {
#pragma unroll
      for (int r = 0; r < 4; ++r) hand_over(8 * r + lane / 4, tops[r]);
    }
  }

  if (!IsLastPart(&work.counters[1 + query_tile], gridDim.y)) return;
  TwoNearest top;
  if (thread < kQueryTile) {
    const int query = first_query + thread;
    if (query < job.query.size && query_norms[thread] >= 0.0f) {
      constexpr int kAtOnce = 16;  // loads under way together
      const int4* partial = reinterpret_cast<const int4*>(work.partial) + blockIdx.x * kQueryTile + thread;
      for (int first = 0; first < static_cast<int>(gridDim.y); first += kAtOnce) {
        int4 others[kAtOnce];
#pragma unroll
        for (int k = 0; k < kAtOnce; ++k) {
          const int split = min(first + k, static_cast<int>(gridDim.y) - 1);
          others[k] = __ldcg(partial + static_cast<std::size_t>(split) * padded_queries);
        }
#pragma unroll
        for (int k = 0; k < kAtOnce; ++k) {
          if (first + k < static_cast<int>(gridDim.y)) {
            Join(top, __int_as_float(others[k].x), __int_as_float(others[k].y), others[k].z);
          }
        }
      }
    }
    top.state = Judge(top, job.options);
    if (is_mutual) work.merged[query] = top;
  }
  if (!is_mutual) WriteResults(job, query_tile, top);
}

// Leaves the matches that are mutual, when all slices are done. A block to a tile of queries.
__global__ void __launch_bounds__(kMatchTile)
    MutualKernel(const __grid_constant__ MatchJob job, const __grid_constant__ MatchWork work) {
  WaitForKernelBefore();
  const int query = blockIdx.x * kMatchTile + threadIdx.x;
  TwoNearest top;
  if (query < job.query.size) {
    const int4 raw = __ldcg(reinterpret_cast<const int4*>(work.merged) + query);
    top = {__int_as_float(raw.x), __int_as_float(raw.y), raw.z, raw.w};
    const std::uint32_t chosen = 0xffffffffu - static_cast<std::uint32_t>(__ldcg(&work.train_best[max(raw.z, 0)]));
    if (chosen != static_cast<std::uint32_t>(query)) top.state = kRejected;
  }
  WriteResults(job, blockIdx.x, top);
  if (!IsLastPart(&work.counters[1], gridDim.x)) return;
  for (int train = threadIdx.x; train < job.train.size; train += kMatchTile) work.train_best[train] = 0;
}

// A thread to an entry of either list; the train list comes second.
__global__ void __launch_bounds__(128)
    PackGatesKernel(const __grid_constant__ MatchJob job, const __grid_constant__ SetBuffers sets,
                    const __grid_constant__ MatchWork work) {
  const int entry = blockIdx.x * 128 + threadIdx.x;
  const bool is_query = entry < job.query.size;
  const int i = is_query ? entry : entry - job.query.size;
  if (!is_query && i >= job.train.size) return;
  const std::int32_t row = RowAt(is_query ? job.query : job.train, i);
  const GateArrays& gates = is_query ? work.query_gates : work.train_gates;
  const auto out = [&](int k) -> float& { return gates.values[static_cast<std::size_t>(k) * gates.capacity + i]; };
  out(0) = sets.keypoints[row].x_px;
  out(1) = sets.keypoints[row].y_px;
  if (job.gate.query_bearings == nullptr) return;
  const std::int32_t feature = row - (is_query ? job.gate.query_set_row : job.gate.train_set_row);
  const float* bearing = (is_query ? job.gate.query_bearings : job.gate.train_bearings) + 3 * feature;
  const float* m = job.gate.essential;
  float normal[3];
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    // E for the query, its transpose for the train descriptor.
    const int first = is_query ? 3 * k : k;
    const int step = is_query ? 1 : 3;
    normal[k] = __fadd_rn(__fadd_rn(__fmul_rn(m[first], bearing[0]), __fmul_rn(m[first + step], bearing[1])),
                          __fmul_rn(m[first + 2 * step], bearing[2]));
  }
  const float norm = __fsqrt_rn(__fadd_rn(__fadd_rn(__fmul_rn(normal[0], normal[0]), __fmul_rn(normal[1], normal[1])),
                                          __fmul_rn(normal[2], normal[2])));
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    out(2 + k) = bearing[k];
    out(5 + k) = __fdiv_rn(normal[k], norm);  // a zero vector becomes NaN, which passes no gate
  }
  out(8) = (is_query ? job.gate.query_tolerance : job.gate.train_tolerance)[feature];
}

using Kernel = void (*)(MatchJob, SetBuffers, MatchWork, MatchSlice);

// By dp4a there is one instance for all requests, to be compiled in bearable time.
Kernel KernelFor(DotProduct dot_product, bool is_gated, bool is_mutual) {
  if (dot_product == DotProduct::kDp4a) return BruteForceKernel<DotProduct::kDp4a, true, true>;
  constexpr DotProduct kDot = DotProduct::kTensorCores;
  if (is_gated) return is_mutual ? BruteForceKernel<kDot, true, true> : BruteForceKernel<kDot, true, false>;
  return is_mutual ? BruteForceKernel<kDot, false, true> : BruteForceKernel<kDot, false, false>;
}

int NumTiles(int size, int tile) { return (size + tile - 1) / tile; }

}  // namespace

cudaError_t PrepareBruteForce(DotProduct dot_product, MatchLimits* limits) {
  for (const bool is_gated : {false, true}) {
    for (const bool is_mutual : {false, true}) {
      const Kernel kernel = KernelFor(dot_product, is_gated, is_mutual);
      const cudaError_t error = cudaFuncSetAttribute(reinterpret_cast<const void*>(kernel),
                                                     cudaFuncAttributeMaxDynamicSharedMemorySize, SharedLayout::kSize);
      if (error != cudaSuccess) return error;
    }
  }
  int device = 0;
  int num_processors = 0;
  int per_processor = 0;
  cudaError_t error = cudaGetDevice(&device);
  if (error == cudaSuccess) {
    error = cudaDeviceGetAttribute(&num_processors, cudaDevAttrMultiProcessorCount, device);
  }
  if (error == cudaSuccess) {
    error = cudaOccupancyMaxActiveBlocksPerMultiprocessor(
        &per_processor, reinterpret_cast<const void*>(KernelFor(dot_product, false, true)), kThreads,
        SharedLayout::kSize);
  }
  limits->max_blocks = num_processors * (per_processor > 0 ? per_processor : 1);
  limits->max_pairs = kNoPairLimit;
  cudaFuncAttributes attributes{};
  if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, MutualKernel);
  limits->can_launch_early = attributes.ptxVersion >= 90;
  return error;
}

MatchLimits InBackground(const MatchLimits& limits, DotProduct dot_product) {
  // Pairs that a multiprocessor gets through in about a millisecond: an H200's does 10 million with two blocks, an
  // Orin's, by its rate of integer products, four times fewer.
  constexpr std::int64_t kPairsPerBlock = 1'200'000;
  const int max_blocks = limits.max_blocks > 1 ? limits.max_blocks / 2 : 1;
  return {max_blocks, max_blocks * kPairsPerBlock / (dot_product == DotProduct::kDp4a ? 2 : 1),
          limits.can_launch_early};
}

std::size_t MaxPartialResults(int max_list, int max_blocks) {
  const std::size_t query_tiles = NumTiles(max_list, kQueryTile);
  // As many splits as fill the device, at least one.
  return (query_tiles + max_blocks) * kQueryTile;
}

int NumMatchCounters(int max_list) { return NumTiles(max_list, kQueryTile) + 1; }

cudaError_t LaunchBruteForce(const MatchJob& job, const SetBuffers& sets, const MatchWork& work, DotProduct dot_product,
                             const MatchLimits& limits, cudaStream_t stream) {
  if (job.is_gated) {
    PackGatesKernel<<<NumTiles(job.query.size + job.train.size, 128), 128, 0, stream>>>(job, sets, work);
    if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  }
  const int query_tiles = NumTiles(job.query.size, kQueryTile);
  const int train_tiles = NumTiles(job.train.size, kTrainTile);
  const std::int64_t pairs_per_query_tile = static_cast<std::int64_t>(train_tiles) * kTrainTile * kQueryTile;
  const int tiles_per_slice =
      static_cast<int>(std::clamp<std::int64_t>(limits.max_pairs / pairs_per_query_tile, 1, query_tiles));
  const Kernel kernel = KernelFor(dot_product, job.is_gated, job.options.mutual);
  for (int first = 0; first < query_tiles; first += tiles_per_slice) {
    const int num_tiles = std::min(tiles_per_slice, query_tiles - first);
    const int splits = std::clamp(limits.max_blocks / num_tiles, 1, train_tiles);
    const int tiles_per_split = NumTiles(train_tiles, splits);
    const dim3 grid(num_tiles, NumTiles(train_tiles, tiles_per_split));
    const cudaError_t error = LaunchAfter(limits.can_launch_early, kernel, grid, kThreads, SharedLayout::kSize, stream,
                                          job, sets, work, MatchSlice{first, tiles_per_split});
    if (error != cudaSuccess) return error;
  }
  if (!job.options.mutual) return cudaSuccess;
  return LaunchAfter(limits.can_launch_early, MutualKernel, query_tiles, kMatchTile, 0, stream, job, work);
}

}  // namespace haustra::kernels::cuda
