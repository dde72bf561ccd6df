#include "platform/daemon/descriptor_sink.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "hal/core/errno_text.h"

namespace haustra {
namespace {

Status Written(int error) { return error == 0 ? Status::Ok() : Unavailable("cannot be written: " + ErrnoText(error)); }

}  // namespace

DescriptorSink::DescriptorSink(int descriptor) : descriptor_(descriptor) {}

DescriptorSink::~DescriptorSink() { ::close(descriptor_); }

Status DescriptorSink::Write(std::string_view bytes) {
  if (status_.ok()) status_ = Written(buffer_.Write(descriptor_, bytes));
  return status_;
}

Status DescriptorSink::Finish() {
  if (status_.ok()) status_ = Written(buffer_.Flush(descriptor_));
  return status_;
}

Result<std::string> ReadWholeFile(int descriptor) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0) return Unavailable("cannot be read: " + ErrnoText(errno));
  if (!S_ISREG(info.st_mode)) return Unavailable("is not a file");
  std::string bytes(static_cast<std::size_t>(info.st_size), '\0');
  std::size_t num_read = 0;
  while (num_read < bytes.size()) {
    const ssize_t count =
        ::pread(descriptor, bytes.data() + num_read, bytes.size() - num_read, static_cast<off_t>(num_read));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return Unavailable("cannot be read: " + ErrnoText(errno));
    if (count == 0) break;  // became shorter meanwhile; the checksums will tell
    num_read += static_cast<std::size_t>(count);
  }
  bytes.resize(num_read);
  return bytes;
}

}  // namespace haustra
