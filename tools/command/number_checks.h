// Checks of numbers on the command line whose messages a person can read: those of CLI11 name the smallest and the
// largest number that there is.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <concepts>
#include <limits>
#include <string>
#include <system_error>

namespace haustra {

inline CLI::Validator NumberCheck(const char* name, const char* what, bool (*is_good)(double)) {
  return CLI::Validator(
      [what, is_good](std::string& text) {
        double value = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && std::isfinite(value) && is_good(value) ? std::string() : "'" + text + "' is not " + what;
      },
      name);
}

// From 0 to what a T holds; CLI11 takes the largest one for what is larger.
template <std::unsigned_integral T>
CLI::Validator WholeNumber() {
  return CLI::Validator(
      [](std::string& text) {
        T value = 0;
        const char* end = text.data() + text.size();
        const auto [stop, error] = std::from_chars(text.data(), end, value);
        if (error == std::errc{} && stop == end) return std::string();
        return "'" + text + "' is not a whole number from 0 to " + std::to_string(std::numeric_limits<T>::max());
      },
      "NONNEGATIVE");
}

inline CLI::Validator PositiveNumber() {
  return NumberCheck("POSITIVE", "a number above 0", [](double value) { return value > 0.0; });
}

}  // namespace haustra
