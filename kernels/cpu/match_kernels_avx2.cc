// Matching with AVX2. The multiply-add of unsigned by signed bytes saturates, so bytes are widened to 16 bits first:
// even and odd bytes of a group of four apart, both exact.
#include <immintrin.h>

#include <cstddef>
#include <cstdint>

#include "kernels/cpu/match_kernels.h"
#include "kernels/cpu/match_kernels_levels.h"

namespace haustra::kernels {
namespace {

constexpr int kGroups = kDescriptorBytes / 4;

void DotTile(const std::uint8_t* queries, const std::uint8_t* train_block, const std::int32_t*,
             std::int32_t dots[kQueryTile][kTrainBlock]) {
  const __m256i low_bytes = _mm256_set1_epi16(0x00ff);
  constexpr int kAtOnce = 4;  // 8 sums stay in registers
  for (int first = 0; first < kQueryTile; first += kAtOnce) {
    // Of each group the even bytes, then the odd bytes, as pairs of 16 bits.
    alignas(32) std::int32_t even[kAtOnce][kGroups];
    alignas(32) std::int32_t odd[kAtOnce][kGroups];
    for (int q = 0; q < kAtOnce; ++q) {
      const std::uint8_t* query = queries + static_cast<std::ptrdiff_t>(first + q) * kDescriptorBytes;
      for (int g = 0; g < kGroups; g += 8) {
        const __m256i bytes = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(query + 4 * g));
        _mm256_store_si256(reinterpret_cast<__m256i*>(even[q] + g), _mm256_and_si256(bytes, low_bytes));
        _mm256_store_si256(reinterpret_cast<__m256i*>(odd[q] + g), _mm256_srli_epi16(bytes, 8));
      }
    }
    __m256i sums[kAtOnce][2];
    for (auto& sum : sums) sum[0] = sum[1] = _mm256_setzero_si256();
    for (int g = 0; g < kGroups; ++g) {
      const std::uint8_t* train = train_block + static_cast<std::ptrdiff_t>(g) * kTrainBlock * 4;
      const __m256i left = _mm256_load_si256(reinterpret_cast<const __m256i*>(train));
      const __m256i right = _mm256_load_si256(reinterpret_cast<const __m256i*>(train + 32));
      const __m256i left_even = _mm256_and_si256(left, low_bytes);
      const __m256i left_odd = _mm256_srli_epi16(left, 8);
      const __m256i right_even = _mm256_and_si256(right, low_bytes);
      const __m256i right_odd = _mm256_srli_epi16(right, 8);
#pragma GCC unroll 4
      for (int q = 0; q < kAtOnce; ++q) {
        const __m256i query_even = _mm256_set1_epi32(even[q][g]);
        const __m256i query_odd = _mm256_set1_epi32(odd[q][g]);
        sums[q][0] = _mm256_add_epi32(sums[q][0], _mm256_add_epi32(_mm256_madd_epi16(left_even, query_even),
                                                                   _mm256_madd_epi16(left_odd, query_odd)));
        sums[q][1] = _mm256_add_epi32(sums[q][1], _mm256_add_epi32(_mm256_madd_epi16(right_even, query_even),
                                                                   _mm256_madd_epi16(right_odd, query_odd)));
      }
    }
    for (int q = 0; q < kAtOnce; ++q) {
      _mm256_store_si256(reinterpret_cast<__m256i*>(dots[first + q]), sums[q][0]);
      _mm256_store_si256(reinterpret_cast<__m256i*>(dots[first + q] + 8), sums[q][1]);
    }
  }
}

std::int32_t Dot(const std::uint8_t* a, const std::uint8_t* b) {
  __m256i sum = _mm256_setzero_si256();
  for (int i = 0; i < kDescriptorBytes; i += 16) {
    const __m256i x = _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(a + i)));
    const __m256i y = _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(b + i)));
    sum = _mm256_add_epi32(sum, _mm256_madd_epi16(x, y));
  }
  __m128i half = _mm_add_epi32(_mm256_castsi256_si128(sum), _mm256_extracti128_si256(sum, 1));
  half = _mm_add_epi32(half, _mm_shuffle_epi32(half, 0x4e));
  half = _mm_add_epi32(half, _mm_shuffle_epi32(half, 0xb1));
  return _mm_cvtsi128_si32(half);
}

}  // namespace
}  // namespace haustra::kernels

#include "kernels/cpu/match_kernels_impl.h"

namespace haustra::kernels {

const MatchKernels kAvx2MatchKernels = kKernels;

}  // namespace haustra::kernels
