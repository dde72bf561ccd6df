#include "platform/daemon/descriptor_sink.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "hal/core/errno_text.h"

namespace haustra {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16;

}  // namespace

DescriptorSink::DescriptorSink(int descriptor) : descriptor_(descriptor) { buffer_.reserve(kBufferBytes); }

DescriptorSink::~DescriptorSink() { ::close(descriptor_); }

Status DescriptorSink::WriteOut(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return Unavailable("cannot be written: " + ErrnoText(errno));
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return Status::Ok();
}

Status DescriptorSink::Write(std::string_view bytes) {
  if (!status_.ok()) return status_;
  if (buffer_.size() + bytes.size() < kBufferBytes) {
    buffer_.append(bytes);
    return Status::Ok();
  }
  HAUSTRA_TRY(Finish());
  status_ = WriteOut(bytes);
  return status_;
}

Status DescriptorSink::Finish() {
  if (!status_.ok()) return status_;
  status_ = WriteOut(buffer_);
  buffer_.clear();
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
