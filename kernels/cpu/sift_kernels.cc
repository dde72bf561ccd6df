#include "kernels/cpu/sift_kernels.h"

#include "kernels/cpu/sift_kernels_levels.h"

namespace haustra::kernels {

const SiftKernels& SiftKernelsFor(SimdLevel level) {
#if defined(__x86_64__)
  if (level == SimdLevel::kAvx512) return kAvx512SiftKernels;
  if (level == SimdLevel::kAvx2) return kAvx2SiftKernels;
#endif
  static_cast<void>(level);
  return kPortableSiftKernels;
}

}  // namespace haustra::kernels
