// Which instruction set the kernels run with. Every level gives the same matches to the bit; extraction is repeatable
// on one level, and differs between levels by rounding only.
#pragma once

#include <string_view>

namespace haustra::kernels {

enum class SimdLevel {
  kPortable,  // compiler vectors of 16 bytes: SSE2 on x86-64, NEON on aarch64
  kNeonDot,   // aarch64 with the dot product instructions
  kAvx2,      // AVX2 and FMA
  kAvx512,    // AVX-512 F, BW, DQ, VL and VNNI
};

std::string_view ToString(SimdLevel level);

// Built into this binary and offered by this processor.
bool IsSupported(SimdLevel level);
SimdLevel BestSimdLevel();

}  // namespace haustra::kernels
