// Where writers put their bytes. The engine knows no file system: capture/files/file_sink.h is the sink that writes
// files, StringSink the one for tests and for whatever is small enough to be kept.
#pragma once

#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra {

// thread-bound(the writer), not rt-safe.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  // All bytes, in order. On error nothing is known about how many were taken, and the sink is of no further use.
  virtual Status Write(std::string_view bytes) = 0;
};

class StringSink final : public ByteSink {
 public:
  Status Write(std::string_view bytes) override {
    bytes_.append(bytes);
    return Status::Ok();
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

}  // namespace haustra
