// Matching in plain C++; the compiler vectorises it with what every processor of the architecture has.
#include <cstddef>
#include <cstdint>

#include "kernels/cpu/match_kernels.h"
#include "kernels/cpu/match_kernels_levels.h"

namespace haustra::kernels {
namespace {

void DotTile(const std::uint8_t* queries, const std::uint8_t* train_block, const std::int32_t*,
             std::int32_t dots[kQueryTile][kTrainBlock]) {
  for (int q = 0; q < kQueryTile; ++q) {
    const std::uint8_t* query = queries + static_cast<std::ptrdiff_t>(q) * kDescriptorBytes;
    std::int32_t sums[kTrainBlock] = {};
    for (int group = 0; group < kDescriptorBytes / 4; ++group) {
      const std::uint8_t* train = train_block + static_cast<std::ptrdiff_t>(group) * kTrainBlock * 4;
      for (int lane = 0; lane < kTrainBlock; ++lane) {
        for (int k = 0; k < 4; ++k) sums[lane] += query[4 * group + k] * train[4 * lane + k];
      }
    }
    for (int lane = 0; lane < kTrainBlock; ++lane) dots[q][lane] = sums[lane];
  }
}

std::int32_t Dot(const std::uint8_t* a, const std::uint8_t* b) {
  std::int32_t sum = 0;
  for (int i = 0; i < kDescriptorBytes; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace
}  // namespace haustra::kernels

#include "kernels/cpu/match_kernels_impl.h"

namespace haustra::kernels {

const MatchKernels kPortableMatchKernels = kKernels;

}  // namespace haustra::kernels
