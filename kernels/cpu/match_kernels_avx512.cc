// Matching with AVX-512 VNNI: four products a lane and instruction, of unsigned by signed bytes. The query is made
// signed by taking 128 off every byte, which 128 times the sum of the train bytes puts back.
#include <immintrin.h>

#include <cstddef>
#include <cstdint>

#include "kernels/cpu/match_kernels.h"
#include "kernels/cpu/match_kernels_levels.h"

namespace haustra::kernels {
namespace {

constexpr int kGroups = kDescriptorBytes / 4;

void DotTile(const std::uint8_t* queries, const std::uint8_t* train_block, const std::int32_t* train_sums,
             std::int32_t dots[kQueryTile][kTrainBlock]) {
  const __m512i offset = _mm512_set1_epi8(static_cast<char>(0x80));
  alignas(64) std::int32_t signed_queries[kQueryTile][kGroups];
  for (int q = 0; q < kQueryTile; ++q) {
    const std::uint8_t* query = queries + static_cast<std::ptrdiff_t>(q) * kDescriptorBytes;
    for (int g = 0; g < kGroups; g += 16) {
      _mm512_store_si512(signed_queries[q] + g, _mm512_xor_si512(_mm512_loadu_si512(query + 4 * g), offset));
    }
  }
  const __m512i start = _mm512_slli_epi32(_mm512_load_si512(train_sums), 7);
  __m512i sums[kQueryTile];
  for (__m512i& sum : sums) sum = start;
#pragma GCC unroll 2
  for (int g = 0; g < kGroups; ++g) {
    const __m512i train = _mm512_load_si512(train_block + static_cast<std::ptrdiff_t>(g) * kTrainBlock * 4);
#pragma GCC unroll 8
    for (int q = 0; q < kQueryTile; ++q) {
      sums[q] = _mm512_dpbusd_epi32(sums[q], train, _mm512_set1_epi32(signed_queries[q][g]));
    }
  }
  for (int q = 0; q < kQueryTile; ++q) _mm512_store_si512(dots[q], sums[q]);
}

std::int32_t Dot(const std::uint8_t* a, const std::uint8_t* b) {
  __m512i sum = _mm512_setzero_si512();
  for (int i = 0; i < kDescriptorBytes; i += 32) {
    const __m512i x = _mm512_cvtepu8_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(a + i)));
    const __m512i y = _mm512_cvtepu8_epi16(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(b + i)));
    sum = _mm512_dpwssd_epi32(sum, x, y);
  }
  return _mm512_reduce_add_epi32(sum);
}

}  // namespace
}  // namespace haustra::kernels

#include "kernels/cpu/match_kernels_impl.h"

namespace haustra::kernels {

const MatchKernels kAvx512MatchKernels = kKernels;

}  // namespace haustra::kernels
