// The table of a soak's samples, which can be read as it grows. thread-bound(the observer of the sessions).
#pragma once

#include <memory>
#include <string>
#include <utility>

#include "hal/core/status.h"
#include "tools/command/line_file.h"
#include "tools/soak/soak_monitor.h"

namespace haustra {

// Begun with the first sample: what fails before leaves an earlier table as it was, and one that is there is replaced
// as a whole. From then on the file has whole lines only.
class SampleFile {
 public:
  // Empty: no file.
  explicit SampleFile(std::string path) : path_(std::move(path)) {}

  void Add(const SoakSample& sample);
  // The first error; no sample is written after it. kUnavailable, kNotFound: no such folder.
  const Status& status() const { return status_; }

 private:
  Status Begin(const SoakSample& first);

  const std::string path_;
  std::unique_ptr<LineFile> lines_;
  Status status_;
};

}  // namespace haustra
