#include "engine/optim/pose_kernels_impl.h"
#include "engine/optim/pose_kernels_levels.h"

namespace haustra::optim {

const PoseKernels kAvx2PoseKernels = kKernels;

}  // namespace haustra::optim
