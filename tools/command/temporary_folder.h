// A folder of our own that goes, with what is in it, when it is no longer needed. From then on a stop is a flag
// (stop_signal.h).
#pragma once

#include <string>

namespace haustra {

class TemporaryFolder {
 public:
  // Empty path: none could be made.
  explicit TemporaryFolder(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace haustra
