// Small seeded random generator: PCG-XSH-RR 64/32 (O'Neill 2014, "PCG: A family of simple fast space-efficient
// statistically good algorithms"). The sequence depends on the seed alone, never on the standard library, so that a run
// can be repeated to the bit on any machine. thread-bound(its owner), rt-safe.
#pragma once

#include <cstdint>
#include <span>

#include "hal/core/check.h"

namespace haustra {

class Rng {
 public:
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0) : increment_((stream << 1) | 1) {
    Next();
    state_ += seed;
    Next();
  }

  // 32 uniform bits.
  std::uint32_t Next() {
    const std::uint64_t old = state_;
    state_ = old * 6364136223846793005ULL + increment_;
    const auto shifted = static_cast<std::uint32_t>(((old >> 18) ^ old) >> 27);
    const auto rotation = static_cast<std::uint32_t>(old >> 59);
    return (shifted >> rotation) | (shifted << ((32 - rotation) & 31));
  }

  // Uniform in [0, bound), bound > 0, without modulo bias (Lemire 2019, "Fast random integer generation in an
  // interval").
  std::uint32_t UniformInt(std::uint32_t bound) {
    HAUSTRA_DCHECK(bound > 0);
    std::uint64_t product = std::uint64_t{Next()} * bound;
    if (static_cast<std::uint32_t>(product) < bound) {
      const std::uint32_t threshold = (0u - bound) % bound;
      while (static_cast<std::uint32_t>(product) < threshold) product = std::uint64_t{Next()} * bound;
    }
    return static_cast<std::uint32_t>(product >> 32);
  }

  // Uniform in [0, 1), 53 bits.
  double Uniform() {
    const std::uint64_t high = Next() >> 5;
    const std::uint64_t low = Next() >> 6;
    return static_cast<double>((high << 26) | low) * 0x1.0p-53;
  }
  // Uniform in [low, high).
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  // Fills `sample` with distinct indices of [0, count), count >= sample.size(). Meant for minimal sets: the cost grows
  // with the square of the sample, and with the number of rejected draws when the sample nearly exhausts the range.
  void SampleDistinct(std::uint32_t count, std::span<int> sample) {
    HAUSTRA_DCHECK(count >= sample.size());
    for (std::size_t i = 0; i < sample.size(); ++i) {
      bool is_new = false;
      while (!is_new) {
        sample[i] = static_cast<int>(UniformInt(count));
        is_new = true;
        for (std::size_t j = 0; j < i; ++j) is_new = is_new && sample[j] != sample[i];
      }
    }
  }

 private:
  std::uint64_t state_ = 0;
  std::uint64_t increment_;
};

}  // namespace haustra
