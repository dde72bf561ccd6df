// Bytes on their way into an open file. Whoever has the file open makes the message of an error. thread-bound(the
// writer), not rt-safe.
#pragma once

#include <string>
#include <string_view>

namespace haustra {

// 0, or the errno of a write; then a part of the bytes may be in the file.
int WriteAll(int descriptor, std::string_view bytes);

// Gathers small pieces. An error is that of WriteAll, and nothing stays buffered after it.
class WriteBuffer {
 public:
  WriteBuffer();

  int Write(int descriptor, std::string_view bytes);
  int Flush(int descriptor);

 private:
  std::string bytes_;
};

}  // namespace haustra
