// Matching as launches on a stream. Similarities have the same bits as the CPU device's: products are exact integers,
// and the few float operations on them are the same, in the same order, without contraction.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "hal/vision_device.h"
#include "kernels/cuda/completion.h"
#include "kernels/cuda/extract_buffers.h"

namespace haustra::kernels::cuda {

// Which rows of the sets' descriptors a list holds.
struct RowList {
  const std::int32_t* rows = nullptr;  // -1: stale; nullptr: first, first + 1, ...
  std::int32_t first = 0;
  std::int32_t size = 0;
};

enum class DotProduct { kTensorCores, kDp4a };

// The tests of kernels/common/match_acceptance.h on the device. Where rounding could decide the ratio test, the host
// decides.
enum MatchState : std::int32_t { kRejected = 0, kAccepted = 1, kBorderline = 2 };

// Best and second best of a query; -1: none. In the results of brute force, state has more in it: mark << kMarkShift |
// query's place in its tile << kQueryShift | MatchState.
struct alignas(16) TwoNearest {
  float best = -1.0f;
  float second = -1.0f;
  std::int32_t best_idx = -1;
  std::int32_t state = kRejected;
};
inline constexpr int kQueryShift = 2;
inline constexpr int kMarkShift = 9;
inline constexpr std::uint32_t kStateMask = (1u << kQueryShift) - 1;
inline constexpr std::uint32_t kLastMark = (1u << (32 - kMarkShift)) - 1;

// Queries are matched so many at a time. The results of each such tile stand from its first query's place on: without
// the rejected ones, in order, and where there are fewer than queries, one that is rejected behind them. A result is
// written by one access of 16 bytes, which the host sees as one (CUDA C++ Programming Guide, "Mapped Memory": naturally
// aligned accesses of up to 16 bytes to host memory are kept whole): when it has the request's mark, it is there.
inline constexpr int kMatchTile = 128;
inline int NumMatchTiles(int num_queries) { return (num_queries + kMatchTile - 1) / kMatchTile; }
static_assert(kMatchTile <= 1 << (kMarkShift - kQueryShift));

// Keypoints of a list for the gates, each value in an array of its own with `capacity` entries: x, y, bearing (3),
// normal of the epipolar plane in the other image (3), tolerance.
inline constexpr int kGateValues = 9;
struct GateArrays {
  float* values = nullptr;
  int capacity = 0;
};

struct GateInput {
  float essential[9] = {};                // train from query
  const float* query_bearings = nullptr;  // of all features of the set, 3 each; nullptr: no epipolar gate
  const float* train_bearings = nullptr;
  const float* query_tolerance = nullptr;
  const float* train_tolerance = nullptr;
  std::int32_t query_set_row = 0;  // row of the set's first feature
  std::int32_t train_set_row = 0;
  int has_window = 0;
  float max_dx_px = 0.0f;
  float max_dy_px = 0.0f;
};

// What a lane's matching works with. Counters and train_best are zero between launches.
struct MatchWork {
  TwoNearest* partial = nullptr;  // splits x queries, rounded up to tiles
  std::size_t max_partial = 0;
  std::int32_t* counters = nullptr;  // one for guided matching, then one a query tile
  unsigned long long* train_best = nullptr;
  TwoNearest* merged = nullptr;
  GateArrays query_gates;
  GateArrays train_gates;
};

// A request as the kernels see it. results: mapped host memory, room for one a query, none of which has the mark yet.
struct MatchJob {
  RowList query;
  RowList train;
  MatchOptions options;
  bool is_gated = false;
  GateInput gate;
  TwoNearest* results = nullptr;
  std::uint32_t mark = 0;  // 1 to kLastMark
};

// What a launch of the matcher may take of the device. A request of more pairs is done in several launches.
struct MatchLimits {
  int max_blocks = 1;  // at the same time
  std::int64_t max_pairs = 0;
  bool can_launch_early = false;  // kernel_launch.cuh
};
inline constexpr std::int64_t kNoPairLimit = std::int64_t{1} << 62;

cudaError_t LaunchBruteForce(const MatchJob& job, const SetBuffers& sets, const MatchWork& work, DotProduct dot_product,
                             const MatchLimits& limits, cudaStream_t stream);
// Must be called once before the first launch; *limits: all that the device at hand holds.
cudaError_t PrepareBruteForce(DotProduct dot_product, MatchLimits* limits);
// For the background lane. Half of the blocks, so that kernels of the tracking lane find room at once (a block stays
// until it is done, whatever its priority), and launches of about a millisecond.
MatchLimits InBackground(const MatchLimits& limits, DotProduct dot_product);
// Most partial results that LaunchBruteForce needs for lists of at most max_list.
std::size_t MaxPartialResults(int max_list, int max_blocks);
// Entries of MatchWork::counters for lists of at most max_list.
int NumMatchCounters(int max_list);

struct GuidedRow {
  std::int32_t row = -1;  // -1: stale, finds nothing
  float x_px = 0.0f;
  float y_px = 0.0f;
  float radius_px = 0.0f;
  float min_scale_px = 0.0f;
  float max_scale_px = 0.0f;
};

struct GuidedJob {
  const GuidedRow* queries = nullptr;
  std::int32_t num_queries = 0;
  std::int32_t train_row = 0;  // of the set's first feature
  std::int32_t num_train = 0;
  const std::uint8_t* train_allowed = nullptr;  // optional
  MatchOptions options;
  TwoNearest* results = nullptr;  // mapped host memory, one a query
  Completion done;
};

cudaError_t LaunchGuided(const GuidedJob& job, const SetBuffers& sets, const MatchWork& work, cudaStream_t stream);

// 1 / |descriptor| of rows that were written by the host.
cudaError_t LaunchInverseNorms(const SetBuffers& sets, std::int32_t first_row, std::int32_t num_rows,
                               cudaStream_t stream);

}  // namespace haustra::kernels::cuda
