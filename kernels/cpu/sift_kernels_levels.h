// The tables that sift_kernels_<level>.cc define; for sift_kernels.cc only.
#pragma once

#include "kernels/cpu/sift_kernels.h"

namespace haustra::kernels {

extern const SiftKernels kPortableSiftKernels;
extern const SiftKernels kAvx2SiftKernels;
extern const SiftKernels kAvx512SiftKernels;

}  // namespace haustra::kernels
