#include "engine/io/text_writer.h"

#include <array>
#include <charconv>

namespace haustra {
namespace {

constexpr std::size_t kFlushBytes = std::size_t{1} << 16;

template <typename T>
void AppendWithToChars(T value, std::string* text) {
  std::array<char, 64> digits;
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  text->append(digits.data(), end);
}

}  // namespace

// Adding zero turns -0 into 0.
void AppendNumber(double value, std::string* text) { AppendWithToChars(value + 0.0, text); }
void AppendNumber(float value, std::string* text) { AppendWithToChars(value + 0.0f, text); }
void AppendInteger(std::int64_t value, std::string* text) { AppendWithToChars(value, text); }

void AppendSeconds(std::int64_t nanoseconds, std::string* text) {
  constexpr std::uint64_t kNanosecondsPerSecond = 1000000000;
  constexpr std::size_t kDecimals = 9;
  const bool is_negative = nanoseconds < 0;
  // Unsigned, because the smallest value has no positive counterpart.
  const std::uint64_t magnitude =
      is_negative ? ~static_cast<std::uint64_t>(nanoseconds) + 1 : static_cast<std::uint64_t>(nanoseconds);
  if (is_negative) text->push_back('-');
  AppendWithToChars(magnitude / kNanosecondsPerSecond, text);
  text->push_back('.');
  std::string decimals;
  AppendWithToChars(magnitude % kNanosecondsPerSecond, &decimals);
  text->append(kDecimals - decimals.size(), '0');
  text->append(decimals);
}

TextWriter& TextWriter::Text(std::string_view text) {
  buffer_.append(text);
  FlushWhenLarge();
  return *this;
}

TextWriter& TextWriter::Number(double value) {
  AppendNumber(value, &buffer_);
  return *this;
}

TextWriter& TextWriter::Number(float value) {
  AppendNumber(value, &buffer_);
  return *this;
}

TextWriter& TextWriter::Integer(std::int64_t value) {
  AppendInteger(value, &buffer_);
  return *this;
}

TextWriter& TextWriter::Seconds(std::int64_t nanoseconds) {
  AppendSeconds(nanoseconds, &buffer_);
  return *this;
}

void TextWriter::FlushWhenLarge() {
  if (buffer_.size() < kFlushBytes) return;
  if (status_.ok()) status_ = sink_.Write(buffer_);
  buffer_.clear();
}

Status TextWriter::Finish() {
  if (status_.ok() && !buffer_.empty()) status_ = sink_.Write(buffer_);
  buffer_.clear();
  return status_;
}

}  // namespace haustra
