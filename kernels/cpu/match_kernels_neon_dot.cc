// Matching with the dot product instructions of ARMv8.2: four unsigned products a lane and instruction, exact.
#include <arm_neon.h>

#include <cstddef>
#include <cstdint>

#include "kernels/cpu/match_kernels.h"
#include "kernels/cpu/match_kernels_levels.h"

namespace haustra::kernels {
namespace {

constexpr int kGroups = kDescriptorBytes / 4;

void DotTile(const std::uint8_t* queries, const std::uint8_t* train_block, const std::int32_t*,
             std::int32_t dots[kQueryTile][kTrainBlock]) {
  constexpr int kAtOnce = 4;  // 16 sums stay in registers
  for (int first = 0; first < kQueryTile; first += kAtOnce) {
    uint32x4_t sums[kAtOnce][4];
    for (auto& sum : sums) sum[0] = sum[1] = sum[2] = sum[3] = vdupq_n_u32(0);
    // Four groups of a query at a time, selected by lane.
    for (int g = 0; g < kGroups; g += 4) {
      uint8x16_t query[kAtOnce];
      for (int q = 0; q < kAtOnce; ++q) {
        query[q] = vld1q_u8(queries + static_cast<std::ptrdiff_t>(first + q) * kDescriptorBytes + 4 * g);
      }
#define HAUSTRA_DOT_GROUP(group)                                                                          \
  do {                                                                                                    \
    const std::uint8_t* train = train_block + static_cast<std::ptrdiff_t>(g + group) * kTrainBlock * 4;   \
    for (int v = 0; v < 4; ++v) {                                                                         \
      const uint8x16_t bytes = vld1q_u8(train + 16 * v);                                                  \
      for (int q = 0; q < kAtOnce; ++q) sums[q][v] = vdotq_laneq_u32(sums[q][v], bytes, query[q], group); \
    }                                                                                                     \
  } while (false)
      HAUSTRA_DOT_GROUP(0);
      HAUSTRA_DOT_GROUP(1);
      HAUSTRA_DOT_GROUP(2);
      HAUSTRA_DOT_GROUP(3);
#undef HAUSTRA_DOT_GROUP
    }
    for (int q = 0; q < kAtOnce; ++q) {
      for (int v = 0; v < 4; ++v) vst1q_s32(dots[first + q] + 4 * v, vreinterpretq_s32_u32(sums[q][v]));
    }
  }
}

std::int32_t Dot(const std::uint8_t* a, const std::uint8_t* b) {
  uint32x4_t sum = vdupq_n_u32(0);
  for (int i = 0; i < kDescriptorBytes; i += 16) sum = vdotq_u32(sum, vld1q_u8(a + i), vld1q_u8(b + i));
  return static_cast<std::int32_t>(vaddvq_u32(sum));
}

}  // namespace
}  // namespace haustra::kernels

#include "kernels/cpu/match_kernels_impl.h"

namespace haustra::kernels {

const MatchKernels kNeonDotMatchKernels = kKernels;

}  // namespace haustra::kernels
