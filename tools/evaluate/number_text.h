// Numbers for people: fixed decimals, independent of the locale. reentrant.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace haustra::evaluate {

std::string Fixed(double value, int decimals);
// "-" for nothing.
std::string Fixed(const std::optional<double>& value, int decimals);
// Blanks before or behind the text, up to `width` characters.
std::string PadLeft(std::string_view text, std::size_t width);
std::string PadRight(std::string_view text, std::size_t width);

}  // namespace haustra::evaluate
