#include "engine/optim/bundle_kernels.h"

#include "engine/optim/bundle_kernels_levels.h"

namespace haustra::optim {

const BundleKernels& BundleKernelsFor(VectorLevel level) {
#if defined(__x86_64__)
  if (level == VectorLevel::kAvx2) return kAvx2BundleKernels;
#endif
  static_cast<void>(level);
  return kPortableBundleKernels;
}

}  // namespace haustra::optim
