// Instruction sets for which the passes of this folder over observations exist (bundle_kernels.h, pose_kernels.h).
// reentrant; no allocation. Private to engine/optim and its tests.
#pragma once

namespace haustra::optim {

enum class VectorLevel {
  kPortable,  // two at a time: SSE2, NEON
  kAvx2,      // four at a time, with FMA
};

bool IsSupported(VectorLevel level);  // by this binary and this processor
VectorLevel BestVectorLevel();

// The most that any of them works on at a time.
inline constexpr int kMaxVectorLanes = 4;

}  // namespace haustra::optim
