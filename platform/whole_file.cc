#include "platform/whole_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace haustra {
namespace {

Status CannotRead(const std::string& path, int error) {
  const std::string text = std::generic_category().message(error);
  return error == ENOENT || error == ENOTDIR ? NotFound(path + ": no such file")
                                             : Unavailable(path + ": cannot be read: " + text);
}

// Closed when it goes out of scope.
struct Descriptor {
  int value = -1;
  ~Descriptor() {
    if (value >= 0) ::close(value);
  }
};

}  // namespace

Result<std::vector<std::uint8_t>> ReadWholeFile(const std::string& path) {
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.value < 0) return CannotRead(path, errno);
  struct stat info {};
  if (::fstat(file.value, &info) != 0) return CannotRead(path, errno);
  if (!S_ISREG(info.st_mode)) return Unavailable(path + ": is not a file");
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(info.st_size));
  std::size_t num_read = 0;
  while (num_read < bytes.size()) {
    const ssize_t count = ::read(file.value, bytes.data() + num_read, bytes.size() - num_read);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return CannotRead(path, errno);
    if (count == 0) break;  // became shorter meanwhile; the checksums will tell
    num_read += static_cast<std::size_t>(count);
  }
  bytes.resize(num_read);
  return bytes;
}

}  // namespace haustra
