#include "capture/files/write_buffer.h"

#include <unistd.h>

#include <cerrno>
#include <cstddef>

namespace haustra {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 16;

}  // namespace

int WriteAll(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

WriteBuffer::WriteBuffer() { bytes_.reserve(kBufferBytes); }

int WriteBuffer::Write(int descriptor, std::string_view bytes) {
  if (bytes_.size() + bytes.size() < kBufferBytes) {
    bytes_.append(bytes);
    return 0;
  }
  const int error = Flush(descriptor);
  return error == 0 ? WriteAll(descriptor, bytes) : error;
}

int WriteBuffer::Flush(int descriptor) {
  const int error = WriteAll(descriptor, bytes_);
  bytes_.clear();
  return error;
}

}  // namespace haustra
