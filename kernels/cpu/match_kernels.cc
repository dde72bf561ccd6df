#include "kernels/cpu/match_kernels.h"

#include "kernels/cpu/match_kernels_levels.h"

namespace haustra::kernels {

const MatchKernels& MatchKernelsFor(SimdLevel level) {
#if defined(__x86_64__)
  if (level == SimdLevel::kAvx512) return kAvx512MatchKernels;
  if (level == SimdLevel::kAvx2) return kAvx2MatchKernels;
#elif defined(__aarch64__)
  if (level == SimdLevel::kNeonDot) return kNeonDotMatchKernels;
#endif
  static_cast<void>(level);
  return kPortableMatchKernels;
}

}  // namespace haustra::kernels
