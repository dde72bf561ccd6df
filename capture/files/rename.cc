#include "capture/files/rename.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <mutex>

namespace haustra {
namespace {

// Between the look at a name and its taking.
std::mutex names_mutex;

}  // namespace

bool LacksRenameFlags(int error) { return error == EINVAL || error == ENOSYS || error == EOPNOTSUPP; }

bool RenameToFreeName(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  if (!LacksRenameFlags(errno)) return false;
  // One step: what would hold the name meanwhile, an empty file or a second link, would outlast a crash.
  const std::lock_guard lock(names_mutex);
  struct stat info {};
  if (::lstat(to.c_str(), &info) == 0) {
    errno = EEXIST;
    return false;
  }
  return errno == ENOENT && std::rename(from.c_str(), to.c_str()) == 0;
}

}  // namespace haustra
