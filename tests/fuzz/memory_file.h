// Bytes under a path, for readers that open files: nothing is written to a disk.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "hal/core/check.h"

namespace haustra::test {

class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : fd_(memfd_create("haustra_fuzz", 0)) {
    HAUSTRA_CHECK(fd_ >= 0);
    HAUSTRA_CHECK(write(fd_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()));
  }
  explicit MemoryFile(std::string_view text)
      : MemoryFile(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size())) {}
  ~MemoryFile() { close(fd_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(fd_); }

 private:
  int fd_;
};

}  // namespace haustra::test
