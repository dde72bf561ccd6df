#include "engine/optim/pose_kernels.h"

#include "engine/optim/pose_kernels_levels.h"

namespace haustra::optim {

const PoseKernels& PoseKernelsFor(VectorLevel level) {
#if defined(__x86_64__)
  if (level == VectorLevel::kAvx2) return kAvx2PoseKernels;
#endif
  static_cast<void>(level);
  return kPortablePoseKernels;
}

}  // namespace haustra::optim
