// Bytes into a file that somebody else has opened, and will make sure of (capture/files/file_sink.h). Messages name no
// file: it has no name here. thread-bound(the writer), not rt-safe.
#pragma once

#include <string>
#include <string_view>

#include "capture/files/write_buffer.h"
#include "hal/core/byte_sink.h"
#include "hal/core/status.h"

namespace haustra {

class DescriptorSink final : public ByteSink {
 public:
  // Takes the descriptor, which is closed at the end.
  explicit DescriptorSink(int descriptor);
  ~DescriptorSink() override;
  DescriptorSink(const DescriptorSink&) = delete;
  DescriptorSink& operator=(const DescriptorSink&) = delete;

  // kUnavailable: disk full, I/O error. After the first error nothing more is written.
  Status Write(std::string_view bytes) override;
  // What is still buffered goes to the system. kUnavailable.
  Status Finish();

 private:
  int descriptor_;
  WriteBuffer buffer_;
  Status status_;
};

// All bytes of a file from its start; kUnavailable when it cannot be read. The descriptor stays open.
Result<std::string> ReadWholeFile(int descriptor);

}  // namespace haustra
