#include "kernels/cpu/sift_kernels_impl.h"
#include "kernels/cpu/sift_kernels_levels.h"

namespace haustra::kernels {

const SiftKernels kPortableSiftKernels = kKernels;

}  // namespace haustra::kernels
