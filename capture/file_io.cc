#include "capture/file_io.h"

#include <cerrno>
#include <cstdio>
#include <memory>
#include <system_error>

namespace haustra::capture::internal {
namespace {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

std::string ErrnoText(int error) { return std::generic_category().message(error); }

}  // namespace

Status ReadFile(const std::string& path, std::size_t max_bytes, std::vector<std::uint8_t>* bytes) {
  const File file(std::fopen(path.c_str(), "rb"));
  if (file == nullptr) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": no such file");
    return Unavailable(path + ": cannot be opened: " + ErrnoText(error));
  }
  constexpr std::size_t kChunk = std::size_t{1} << 18;
  std::size_t size = 0;
  for (;;) {
    bytes->resize(size + kChunk);
    const std::size_t num_read = std::fread(bytes->data() + size, 1, kChunk, file.get());
    size += num_read;
    if (size > max_bytes) {
      bytes->clear();
      return CapacityExceeded(path + ": longer than " + std::to_string(max_bytes) + " bytes");
    }
    if (num_read < kChunk) {
      if (std::ferror(file.get()) != 0) {
        const int error = errno;
        bytes->clear();
        return Unavailable(path + ": cannot be read: " + ErrnoText(error));
      }
      break;
    }
  }
  bytes->resize(size);
  return Status::Ok();
}

Result<std::string> ReadTextFile(const std::string& path, std::size_t max_bytes) {
  std::vector<std::uint8_t> bytes;
  HAUSTRA_TRY(ReadFile(path, max_bytes, &bytes));
  return std::string(bytes.begin(), bytes.end());
}

Status WriteFile(const std::string& path, std::span<const std::uint8_t> bytes) {
  File file(std::fopen(path.c_str(), "wb"));
  if (file == nullptr) return Unavailable(path + ": cannot be created: " + ErrnoText(errno));
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size();
  const int write_error = errno;
  // Buffered bytes reach the disk at the latest here, so a full disk may show only now.
  const bool closed = std::fclose(file.release()) == 0;
  if (!written) return Unavailable(path + ": cannot be written: " + ErrnoText(write_error));
  if (!closed) return Unavailable(path + ": cannot be written: " + ErrnoText(errno));
  return Status::Ok();
}

Status WriteTextFile(const std::string& path, std::string_view text) {
  return WriteFile(path, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

}  // namespace haustra::capture::internal
