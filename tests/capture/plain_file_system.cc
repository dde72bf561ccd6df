#include "tests/capture/plain_file_system.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace haustra {
namespace {

std::atomic<bool> is_plain{false};

}  // namespace

PlainFileSystem::PlainFileSystem() { is_plain = true; }
PlainFileSystem::~PlainFileSystem() { is_plain = false; }

}  // namespace haustra

extern "C" int renameat2(int old_folder, const char* old_name, int new_folder, const char* new_name,
                         unsigned int flags) noexcept {
  if (flags != 0 && haustra::is_plain) {
    errno = EINVAL;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_renameat2, old_folder, old_name, new_folder, new_name, flags));
}
