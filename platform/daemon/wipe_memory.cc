#include "platform/daemon/wipe_memory.h"

#include <malloc.h>

namespace haustra {

void OverwriteFreedMemory() { ::mallopt(M_PERTURB, 0x5a); }

void ReturnFreeMemory() { ::malloc_trim(0); }

}  // namespace haustra
