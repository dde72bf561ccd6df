// Text for files that machines read: independent of the locale, the same on every run, and exact: a floating-point
// number is written with the fewest digits that read back to the same value, a time without passing through floating
// point.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "hal/core/byte_sink.h"

namespace haustra {

void AppendNumber(double value, std::string* text);
void AppendNumber(float value, std::string* text);
void AppendInteger(std::int64_t value, std::string* text);
// Nanoseconds as seconds with nine decimals: -1500000000 gives "-1.500000000".
void AppendSeconds(std::int64_t nanoseconds, std::string* text);

// Collects text and hands it on in large pieces. The first error of the sink is kept and returned by Finish; what is
// written after it is thrown away. thread-bound(the writer), not rt-safe.
class TextWriter {
 public:
  explicit TextWriter(ByteSink& sink) : sink_(sink) {}

  TextWriter& Text(std::string_view text);
  TextWriter& Number(double value);
  TextWriter& Number(float value);
  TextWriter& Integer(std::int64_t value);
  TextWriter& Seconds(std::int64_t nanoseconds);

  // Hands over the rest. Nothing is written after it.
  [[nodiscard]] Status Finish();

 private:
  void FlushWhenLarge();

  ByteSink& sink_;
  std::string buffer_;
  Status status_;
};

}  // namespace haustra
