#include "engine/optim/bundle_kernels_impl.h"
#include "engine/optim/bundle_kernels_levels.h"

namespace haustra::optim {

const BundleKernels kAvx2BundleKernels = kKernels;

}  // namespace haustra::optim
