// A text file that grows by whole lines: it can be read as it grows, and after a stop at any moment. thread-safe.
#pragma once

#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "hal/core/status.h"

namespace haustra {

class LineFile {
 public:
  // A descriptor that appends (O_APPEND) to a file that is empty or ends with a whole line; it is closed at the end.
  LineFile(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;

  // A line with its break; `to_disk`: waits for that. kUnavailable: it could not be written to its end. Then its
  // beginning is taken back, and no other line is written.
  Status Append(std::string_view line, bool to_disk = false);

 private:
  Status WriteWhole(std::string_view line);

  const std::string path_;
  const int descriptor_;
  std::mutex mutex_;
  Status status_;  // the first error
};

}  // namespace haustra
