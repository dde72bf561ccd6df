#include "tools/evaluate/number_text.h"

#include <array>
#include <charconv>

namespace haustra::evaluate {

std::string Fixed(double value, int decimals) {
  std::array<char, 400> digits;  // the largest double has 309 before the point
  const auto [end, error] =
      std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::fixed, decimals);
  return std::string(digits.data(), end);
}

std::string Fixed(const std::optional<double>& value, int decimals) { return value ? Fixed(*value, decimals) : "-"; }

std::string PadLeft(std::string_view text, std::size_t width) {
  return std::string(width > text.size() ? width - text.size() : 0, ' ').append(text);
}

std::string PadRight(std::string_view text, std::size_t width) {
  std::string padded(text);
  if (width > text.size()) padded.append(width - text.size(), ' ');
  return padded;
}

}  // namespace haustra::evaluate
