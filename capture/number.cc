#include "capture/number.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

#include "capture/concat.h"

namespace haustra::capture::internal {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

std::string Quoted(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  if (text.size() > kLongest) return Concat("'", text.substr(0, kLongest), "...'");
  return Concat("'", text, "'");
}

// from_chars takes no leading plus, which people write.
std::string_view WithoutPlus(std::string_view text) {
  const bool has_plus = text.size() > 1 && text[0] == '+' && text[1] != '-' && text[1] != '+';
  return has_plus ? text.substr(1) : text;
}

// The ways in which YAML, C and MATLAB write what is not a finite number.
bool IsNotFiniteWord(std::string_view text) {
  if (!text.empty() && (text[0] == '+' || text[0] == '-')) text.remove_prefix(1);
  if (!text.empty() && text[0] == '.') text.remove_prefix(1);
  std::string lower;
  for (const char c : text.substr(0, 10)) lower += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return lower == "nan" || lower == "inf" || lower == "infinity";
}

}  // namespace

Result<double> ParseDouble(std::string_view text) {
  if (IsNotFiniteWord(text)) return InvalidArgument(Quoted(text) + " is not finite");
  const std::string_view digits = WithoutPlus(text);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::result_out_of_range) return InvalidArgument(Quoted(text) + " is out of range");
  if (error != std::errc() || end != digits.data() + digits.size()) {
    return InvalidArgument(Quoted(text) + " is not a number");
  }
  if (!std::isfinite(value)) return InvalidArgument(Quoted(text) + " is not finite");
  return value;
}

Result<std::int64_t> ParseInteger(std::string_view text) {
  const std::string_view digits = WithoutPlus(text);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::result_out_of_range) return InvalidArgument(Quoted(text) + " is out of range");
  if (error != std::errc() || end != digits.data() + digits.size()) {
    return InvalidArgument(Quoted(text) + " is not a whole number");
  }
  return value;
}

Result<std::int64_t> ParseSeconds(std::string_view text) {
  // Leaves room for the nanoseconds: |seconds| < 2^63 / 1e9.
  constexpr std::int64_t kMaxSeconds = std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond - 1;

  std::string_view digits = WithoutPlus(text);
  const bool is_negative = !digits.empty() && digits[0] == '-';
  if (is_negative) digits.remove_prefix(1);
  std::int64_t seconds = 0;
  std::size_t i = 0;
  for (; i < digits.size() && IsDigit(digits[i]); ++i) {
    seconds = seconds * 10 + (digits[i] - '0');
    if (seconds > kMaxSeconds) return InvalidArgument(Quoted(text) + " seconds are out of range");
  }
  const std::size_t num_whole = i;
  std::int64_t nanoseconds = 0;
  std::size_t num_fraction = 0;
  if (i < digits.size() && digits[i] == '.') {
    std::int64_t unit = kNanosecondsPerSecond / 10;
    for (++i; i < digits.size() && IsDigit(digits[i]); ++i, ++num_fraction) {
      nanoseconds += (digits[i] - '0') * unit;
      if (num_fraction == 9 && digits[i] >= '5') ++nanoseconds;
      unit /= 10;
    }
  }
  if (i == digits.size() && num_whole + num_fraction > 0) {
    const std::int64_t total = seconds * kNanosecondsPerSecond + nanoseconds;
    return is_negative ? -total : total;
  }
  HAUSTRA_ASSIGN(const double value, ParseDouble(text));
  if (std::abs(value) > static_cast<double>(kMaxSeconds)) {
    return InvalidArgument(Quoted(text) + " seconds are out of range");
  }
  return static_cast<std::int64_t>(std::llround(value * 1e9));
}

std::string FormatDouble(double value) {
  std::array<char, 32> text;
  const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value);
  return std::string(text.data(), end);
}

std::string FormatSeconds(std::int64_t nanoseconds) {
  const std::int64_t seconds = nanoseconds / kNanosecondsPerSecond;
  const std::int64_t rest = std::abs(nanoseconds % kNanosecondsPerSecond);
  std::string fraction = std::to_string(rest);
  fraction.insert(0, 9 - fraction.size(), '0');
  const bool is_small_negative = nanoseconds < 0 && seconds == 0;
  return Concat(is_small_negative ? "-" : "", std::to_string(seconds), ".", fraction);
}

std::string SizeText(int width_px, int height_px) { return std::to_string(width_px) + "x" + std::to_string(height_px); }

}  // namespace haustra::capture::internal
