#include "platform/config/config_field.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace haustra {
namespace {

template <typename T>
bool ParseAll(std::string_view text, T* value) {
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && stop == end;
}

template <typename T>
std::string Shortest(T value) {
  char buffer[64];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value);
  HAUSTRA_CHECK(error == std::errc());
  return std::string(buffer, end);
}

bool IsControl(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

// Bounds of integers are written without exponent.
std::string Bound(ConfigType type, double bound) {
  return type == ConfigType::kInteger ? Shortest(static_cast<std::int64_t>(bound)) : Shortest(bound);
}

}  // namespace

std::string ToText(const ConfigValue& value) {
  if (const bool* flag = std::get_if<bool>(&value)) return *flag ? "true" : "false";
  if (const std::int64_t* integer = std::get_if<std::int64_t>(&value)) return Shortest(*integer);
  if (const double* number = std::get_if<double>(&value)) return Shortest(*number);
  return std::get<std::string>(value);
}

std::string ConfigField::Allowed() const {
  switch (type) {
    case ConfigType::kBool: return "true or false";
    case ConfigType::kInteger: return "an integer from " + Bound(type, range.min) + " to " + Bound(type, range.max);
    case ConfigType::kNumber: return "a number from " + Bound(type, range.min) + " to " + Bound(type, range.max);
    case ConfigType::kText: return "any text on one line";
    case ConfigType::kChoice: break;
  }
  std::string names;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) names += i + 1 == choices.size() ? " or " : ", ";
    names += choices[i];
  }
  return names;
}

Result<ConfigValue> ConfigField::Parse(std::string_view text, bool is_quoted) const {
  const auto refuse = [&](std::string_view what) {
    const std::string quote = is_quoted ? "\"" : "'";
    return FailedPrecondition(quote + std::string(text) + quote + " " + std::string(what) + "; allowed: " + Allowed());
  };
  if (type == ConfigType::kChoice) {
    if (std::find(choices.begin(), choices.end(), text) == choices.end()) return refuse("is not known");
    return ConfigValue(std::in_place_type<std::string>, text);
  }
  if (type == ConfigType::kText) {
    if (std::any_of(text.begin(), text.end(), IsControl)) return refuse("holds a control character");
    return ConfigValue(std::in_place_type<std::string>, text);
  }
  if (is_quoted) return refuse("is a string");
  if (type == ConfigType::kBool) {
    if (text == "true") return ConfigValue(true);
    if (text == "false") return ConfigValue(false);
    return refuse("is neither true nor false");
  }
  double number = 0.0;
  if (!ParseAll(text, &number)) return refuse("is not a number");
  if (!std::isfinite(number)) return refuse("is not finite");
  std::int64_t integer = 0;
  if (type == ConfigType::kInteger && !ParseAll(text, &integer)) return refuse("is not an integer");
  if (number < range.min || number > range.max) return refuse("is out of range");
  if (type == ConfigType::kInteger) return ConfigValue(integer);
  return ConfigValue(number);
}

}  // namespace haustra
