#include "platform/daemon/procedure_number.h"

#include <sys/random.h>

#include <cerrno>

#include "hal/core/errno_text.h"

namespace haustra {

Result<std::uint64_t> DrawRun() {
  std::uint64_t bits = 0;
  ssize_t count = 0;
  do {
    count = ::getrandom(&bits, sizeof bits, 0);
  } while (count < 0 && errno == EINTR);
  if (count != static_cast<ssize_t>(sizeof bits)) {
    return Unavailable("the system gives no random bytes: " + ErrnoText(errno));
  }
  return 1 + bits % kNumRuns;
}

}  // namespace haustra
