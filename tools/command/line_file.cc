#include "tools/command/line_file.h"

#include <unistd.h>

#include <cerrno>

#include "hal/core/errno_text.h"

namespace haustra {

LineFile::~LineFile() { ::close(descriptor_); }

Status LineFile::Append(std::string_view line, bool to_disk) {
  {
    const std::lock_guard lock(mutex_);
    if (status_.ok()) status_ = WriteWhole(line);
    HAUSTRA_TRY(status_);
  }
  if (!to_disk || ::fdatasync(descriptor_) == 0) return Status::Ok();
  return Unavailable(path_ + ": cannot be written: " + ErrnoText(errno));
}

Status LineFile::WriteWhole(std::string_view line) {
  const ssize_t written = ::write(descriptor_, line.data(), line.size());
  if (written == static_cast<ssize_t>(line.size())) return Status::Ok();
  if (written < 0) return Unavailable(path_ + ": cannot be written: " + ErrnoText(errno));
  // A write that ends early is no error to the system: only the next one would be. When its beginning stays it is the
  // last of the file, as after a stop in the middle of a write.
  const off_t end = ::lseek(descriptor_, 0, SEEK_END);
  if (end >= written && ::ftruncate(descriptor_, end - written) != 0) {
    return Unavailable(path_ + ": ends with a part of a line: " + ErrnoText(errno));
  }
  return Unavailable(path_ + ": cannot be written: only " + std::to_string(written) + " of " +
                     std::to_string(line.size()) + " bytes had room on the disk");
}

}  // namespace haustra
