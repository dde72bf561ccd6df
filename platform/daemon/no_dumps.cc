#include "platform/daemon/no_dumps.h"

#include <sys/mman.h>
#include <sys/prctl.h>

#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>

namespace haustra {

bool ForbidDumps() { return ::prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0; }

void LeaveMemoryOutOfDumps() {
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    std::uintptr_t begin = 0, end = 0;
    char rights[5] = "";
    if (std::sscanf(line.c_str(), "%" SCNxPTR "-%" SCNxPTR " %4s", &begin, &end, rights) != 3) continue;
    if (rights[1] != 'w') continue;
    // A device's own memory refuses; it is never dumped.
    (void)::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTDUMP);
  }
}

}  // namespace haustra
