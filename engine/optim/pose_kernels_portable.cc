#include "engine/optim/pose_kernels_impl.h"
#include "engine/optim/pose_kernels_levels.h"

namespace haustra::optim {

const PoseKernels kPortablePoseKernels = kKernels;

}  // namespace haustra::optim
