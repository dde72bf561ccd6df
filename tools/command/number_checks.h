// Checks of numbers on the command line whose messages a person can read: those of CLI11 name the smallest and the
// largest number that there is.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

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

inline CLI::Validator NonNegativeNumber() {
  return NumberCheck("NONNEGATIVE", "a number from 0 on", [](double value) { return value >= 0.0; });
}

inline CLI::Validator PositiveNumber() {
  return NumberCheck("POSITIVE", "a number above 0", [](double value) { return value > 0.0; });
}

}  // namespace haustra
