#include "tests/capture/plain_file_system.h"

#include <fcntl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace haustra {
namespace {

constexpr int kEnded = 7;  // exit code

std::atomic<bool> is_plain{false};
std::atomic<int> num_steps_left{-1};  // -1: all that there are

void Step() {
  if (num_steps_left < 0) return;
  if (num_steps_left-- == 0) ::_exit(kEnded);
}

}  // namespace

PlainFileSystem::PlainFileSystem() { is_plain = true; }
PlainFileSystem::~PlainFileSystem() { is_plain = false; }

bool PlainFileSystem::EndsBeforeStep(int step, const std::function<void()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    is_plain = true;
    num_steps_left = step - 1;
    work();
    ::_exit(0);
  }
  int status = 0;
  return ::waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == kEnded;
}

}  // namespace haustra

extern "C" int renameat2(int old_folder, const char* old_name, int new_folder, const char* new_name,
                         unsigned int flags) noexcept {
  haustra::Step();
  if (flags != 0 && haustra::is_plain) {
    errno = EINVAL;
    return -1;
  }
  return static_cast<int>(::syscall(SYS_renameat2, old_folder, old_name, new_folder, new_name, flags));
}

extern "C" int rename(const char* old_name, const char* new_name) noexcept {
  haustra::Step();
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, old_name, AT_FDCWD, new_name, 0));
}

extern "C" int link(const char* old_name, const char* new_name) noexcept {
  haustra::Step();
  return static_cast<int>(::syscall(SYS_linkat, AT_FDCWD, old_name, AT_FDCWD, new_name, 0));
}

extern "C" int unlink(const char* name) noexcept {
  haustra::Step();
  return static_cast<int>(::syscall(SYS_unlinkat, AT_FDCWD, name, 0));
}
