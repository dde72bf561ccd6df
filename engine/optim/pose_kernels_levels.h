// The tables that pose_kernels_<level>.cc define; for pose_kernels.cc only.
#pragma once

#include "engine/optim/pose_kernels.h"

namespace haustra::optim {

extern const PoseKernels kPortablePoseKernels;
extern const PoseKernels kAvx2PoseKernels;

}  // namespace haustra::optim
