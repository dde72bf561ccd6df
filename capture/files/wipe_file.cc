#include "capture/files/wipe_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <vector>

#include "capture/files/write_buffer.h"
#include "hal/core/errno_text.h"

namespace haustra {
namespace {

Status Wiped(int error, const std::string& path) {
  return error == 0 ? Status::Ok() : Unavailable(path + ": cannot be wiped: " + ErrnoText(error));
}

// To the disk, and closes it. 0, or an error of the system.
int Overwrite(int descriptor) {
  struct stat info {};
  int error = ::fstat(descriptor, &info) == 0 ? 0 : errno;
  const std::vector<char> zeros(std::size_t{1} << 16);
  for (off_t at = 0; error == 0 && at < info.st_size; at += static_cast<off_t>(zeros.size())) {
    const auto count = static_cast<std::size_t>(std::min<off_t>(info.st_size - at, static_cast<off_t>(zeros.size())));
    error = WriteAll(descriptor, {zeros.data(), count});
  }
  if (error == 0 && ::fsync(descriptor) != 0) error = errno;
  ::close(descriptor);
  return error;
}

}  // namespace

Status WipeFile(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  int error = descriptor < 0 ? errno : Overwrite(descriptor);
  if (error == 0 && ::unlink(path.c_str()) != 0 && errno != ENOENT) error = errno;
  return error == 0 ? SyncFolderOf(path) : Wiped(error, path);
}

Status WipeUnnamedFile(int descriptor, const std::string& path) { return Wiped(Overwrite(descriptor), path); }

Status SyncFolderOf(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return Status::Ok();
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  if (error == 0 || error == EINVAL || error == EROFS) return Status::Ok();
  return Unavailable(path + ": is in place, but may not outlast a power cut: " + ErrnoText(error));
}

}  // namespace haustra
