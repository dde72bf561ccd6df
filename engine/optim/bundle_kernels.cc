#include "engine/optim/bundle_kernels.h"

#include "engine/optim/bundle_kernels_levels.h"

namespace haustra::optim {

bool IsSupported(BundleLevel level) {
  switch (level) {
    case BundleLevel::kPortable: return true;
    case BundleLevel::kAvx2:
#if defined(__x86_64__)
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
      return false;
#endif
  }
  return false;
}

const BundleKernels& BundleKernelsFor(BundleLevel level) {
#if defined(__x86_64__)
  if (level == BundleLevel::kAvx2) return kAvx2BundleKernels;
#endif
  static_cast<void>(level);
  return kPortableBundleKernels;
}

const BundleKernels& BestBundleKernels() {
  return BundleKernelsFor(IsSupported(BundleLevel::kAvx2) ? BundleLevel::kAvx2 : BundleLevel::kPortable);
}

}  // namespace haustra::optim
