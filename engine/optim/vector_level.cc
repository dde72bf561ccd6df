#include "engine/optim/vector_level.h"

namespace haustra::optim {

bool IsSupported(VectorLevel level) {
  switch (level) {
    case VectorLevel::kPortable: return true;
    case VectorLevel::kAvx2:
#if defined(__x86_64__)
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
      return false;
#endif
  }
  return false;
}

VectorLevel BestVectorLevel() { return IsSupported(VectorLevel::kAvx2) ? VectorLevel::kAvx2 : VectorLevel::kPortable; }

}  // namespace haustra::optim
