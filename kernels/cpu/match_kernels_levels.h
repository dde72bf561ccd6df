// The tables that match_kernels_<level>.cc define; for match_kernels.cc only.
#pragma once

#include "kernels/cpu/match_kernels.h"

namespace haustra::kernels {

extern const MatchKernels kPortableMatchKernels;
extern const MatchKernels kNeonDotMatchKernels;
extern const MatchKernels kAvx2MatchKernels;
extern const MatchKernels kAvx512MatchKernels;

}  // namespace haustra::kernels
