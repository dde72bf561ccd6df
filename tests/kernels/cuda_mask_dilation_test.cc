// Dilation of masks by words: no device is needed.
#include "kernels/cuda/mask_dilation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

namespace haustra::testing {
namespace {

constexpr int kRowWords = 7;
constexpr int kRowPx = 32 * kRowWords;

std::vector<bool> DilatedByWords(const std::vector<bool>& row, int reach) {
  std::uint32_t words[kRowWords] = {};
  for (int x = 0; x < kRowPx; ++x) words[x / 32] |= row[x] ? 1u << x % 32 : 0u;
  std::vector<bool> dilated(kRowPx);
  for (int x = 0; x < kRowPx; ++x) {
    const std::uint32_t word = kernels::cuda::DilatedWord(reach, [&](int k) {
      const int at = x / 32 + k;
      return at >= 0 && at < kRowWords ? words[at] : 0u;
    });
    dilated[x] = (word >> x % 32 & 1) != 0;
  }
  return dilated;
}

std::vector<bool> DilatedByPixels(const std::vector<bool>& row, int reach) {
  std::vector<bool> dilated(kRowPx);
  for (int x = 0; x < kRowPx; ++x) {
    for (int from = std::max(x - reach, 0); from <= std::min(x + reach, kRowPx - 1); ++from) {
      if (row[from]) dilated[x] = true;
    }
  }
  return dilated;
}

TEST(MaskDilation, OfEverySinglePixelIsTheNaiveOne) {
  for (int reach = 0; reach <= 66; ++reach) {
    for (int x = 0; x < kRowPx; ++x) {
      std::vector<bool> row(kRowPx);
      row[x] = true;
      ASSERT_EQ(DilatedByWords(row, reach), DilatedByPixels(row, reach)) << "reach " << reach << ", pixel " << x;
    }
  }
}

TEST(MaskDilation, OfRandomRowsIsTheNaiveOne) {
  std::mt19937 random(7);
  for (int reach = 0; reach <= 66; ++reach) {
    for (const int one_in : {2, 9, 80}) {
      for (int i = 0; i < 20; ++i) {
        std::vector<bool> row(kRowPx);
        for (int x = 0; x < kRowPx; ++x) row[x] = random() % one_in == 0;
        ASSERT_EQ(DilatedByWords(row, reach), DilatedByPixels(row, reach)) << "reach " << reach;
      }
    }
  }
}

}  // namespace
}  // namespace haustra::testing
