#include "capture/files/whole_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "capture/files/owned_descriptor.h"
#include "hal/core/errno_text.h"

namespace haustra {
namespace {

// What a file grows by while it is read: a pipe, or a file of the kernel, tells no size.
constexpr std::size_t kChunkBytes = std::size_t{1} << 16;

template <typename Bytes>
Status ReadInto(const std::string& path, std::size_t max_bytes, Bytes* bytes) {
  const OwnedDescriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.value < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": no such file");
    return Unavailable(path + ": cannot be opened: " + ErrnoText(error));
  }
  struct stat info {};
  if (::fstat(file.value, &info) != 0) return Unavailable(path + ": cannot be read: " + ErrnoText(errno));
  if (S_ISDIR(info.st_mode)) return DataLoss(path + ": is a folder, not a file");
  const Status too_long = CapacityExceeded(path + ": longer than " + std::to_string(max_bytes) + " bytes");
  const std::size_t told = S_ISREG(info.st_mode) ? static_cast<std::size_t>(info.st_size) : 0;
  if (told > max_bytes) return too_long;

  // One byte more than there should be: the end shows as a reading that gives nothing, and only that is the end.
  std::size_t size = 0;
  bytes->resize(told + 1);
  for (;;) {
    const ssize_t count = ::read(file.value, bytes->data() + size, bytes->size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return Unavailable(path + ": cannot be read: " + ErrnoText(errno));
    if (count == 0) break;
    size += static_cast<std::size_t>(count);
    if (size > max_bytes) return too_long;
    if (size == bytes->size()) bytes->resize(size + std::max(size / 2, kChunkBytes));
  }
  bytes->resize(size);
  return Status::Ok();
}

template <typename Bytes>
Result<Bytes> ReadAll(const std::string& path, std::size_t max_bytes) {
  Bytes bytes;
  HAUSTRA_TRY(ReadInto(path, max_bytes, &bytes));
  return bytes;
}

}  // namespace

Status ReadWholeFile(const std::string& path, std::size_t max_bytes, std::vector<std::uint8_t>* bytes) {
  Status status = ReadInto(path, max_bytes, bytes);
  if (!status.ok()) bytes->clear();
  return status;
}

Result<std::vector<std::uint8_t>> ReadWholeFile(const std::string& path, std::size_t max_bytes) {
  return ReadAll<std::vector<std::uint8_t>>(path, max_bytes);
}

Result<std::string> ReadWholeText(const std::string& path, std::size_t max_bytes) {
  return ReadAll<std::string>(path, max_bytes);
}

}  // namespace haustra
