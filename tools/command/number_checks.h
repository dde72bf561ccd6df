// Checks of numbers on the command line. Of those of CLI11 the messages name the smallest and the largest number that
// there is, CLI::Range takes nan for a number of any range, and whole numbers with a leading zero are octal.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <concepts>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>

namespace haustra {

inline CLI::Validator NumberCheck(std::string name, std::string what, std::function<bool(double)> is_good) {
  return CLI::Validator(
      [what = std::move(what), is_good = std::move(is_good)](std::string& text) {
        double value = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        return is_number && std::isfinite(value) && is_good(value) ? std::string() : "'" + text + "' is not " + what;
      },
      std::move(name));
}

// Both ends included; for `transform`, not `check`. The number is given on without leading zeros: names of frames have
// them, and CLI11 would take it for octal.
template <std::integral T>
CLI::Validator WholeNumberBetween(T least, T most) {
  const std::string range = std::to_string(least) + " to " + std::to_string(most);
  return CLI::Validator(
      [least, most, range](std::string& text) {
        T value = 0;
        const char* end = text.data() + text.size();
        const auto [stop, error] = std::from_chars(text.data(), end, value);
        if (error != std::errc{} || stop != end || value < least || value > most) {
          return "'" + text + "' is not a whole number from " + range;
        }
        text = std::to_string(value);
        return std::string();
      },
      "in [" + std::to_string(least) + " - " + std::to_string(most) + "]");
}

// The same from 0 to what a T holds.
template <std::unsigned_integral T>
CLI::Validator WholeNumber() {
  return WholeNumberBetween(T{0}, std::numeric_limits<T>::max()).description("NONNEGATIVE");
}

inline CLI::Validator PositiveNumber() {
  return NumberCheck("POSITIVE", "a number above 0", [](double value) { return value > 0.0; });
}

// Both ends included.
inline CLI::Validator NumberBetween(double least, double most) {
  std::ostringstream name, what;
  name << "in [" << least << " - " << most << "]";
  what << "a number from " << least << " to " << most;
  return NumberCheck(name.str(), what.str(), [least, most](double value) { return value >= least && value <= most; });
}

}  // namespace haustra
