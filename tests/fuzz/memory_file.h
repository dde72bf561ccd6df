// Bytes under a path, for readers that open files: nothing is written to a disk.
#pragma once

#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <deque>
#include <filesystem>
#include <initializer_list>
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

// Takes the part before the first form feed off the text: several texts in one file of a corpus.
inline std::string_view TakePart(std::string_view* text) {
  const std::size_t end = text->find('\f');
  const std::string_view part = text->substr(0, end);
  *text = end == std::string_view::npos ? std::string_view() : text->substr(end + 1);
  return part;
}

// A folder of such files, for readers that open several. Each name gets the next part of the bytes; what is empty is
// not there.
class MemoryFolder {
 public:
  MemoryFolder(std::span<const std::uint8_t> bytes, std::initializer_list<const char*> names) {
    std::string pattern = (std::filesystem::temp_directory_path() / "haustra_fuzz_XXXXXX").string();
    HAUSTRA_CHECK(mkdtemp(pattern.data()) != nullptr);
    path_ = pattern;
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    for (const char* name : names) {
      const std::string_view part = TakePart(&text);
      if (part.empty()) continue;
      const std::filesystem::path link = path_ / name;
      std::filesystem::create_directories(link.parent_path());
      std::filesystem::create_symlink(files_.emplace_back(part).path(), link);
    }
  }
  ~MemoryFolder() { std::filesystem::remove_all(path_); }
  MemoryFolder(const MemoryFolder&) = delete;
  MemoryFolder& operator=(const MemoryFolder&) = delete;

  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
  std::deque<MemoryFile> files_;
};

}  // namespace haustra::test
