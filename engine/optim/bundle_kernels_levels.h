// The tables that bundle_kernels_<level>.cc define; for bundle_kernels.cc only.
#pragma once

#include "engine/optim/bundle_kernels.h"

namespace haustra::optim {

extern const BundleKernels kPortableBundleKernels;
extern const BundleKernels kAvx2BundleKernels;

}  // namespace haustra::optim
