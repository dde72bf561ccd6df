// JSON files. reentrant.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "hal/core/status.h"

namespace haustra::evaluate {

// Errors of ReadText; kInvalidArgument, with the file: not JSON, or no object.
Result<nlohmann::json> ReadJsonObject(const std::string& path);

// Nothing: not an integer, or not one that T holds.
template <typename T>
std::optional<T> IntegerOf(const nlohmann::json& json) {
  if (!json.is_number_integer()) return std::nullopt;
  const bool fits = json.is_number_unsigned() ? std::in_range<T>(json.get<std::uint64_t>())
                                              : std::in_range<T>(json.get<std::int64_t>());
  return fits ? std::optional<T>(json.get<T>()) : std::nullopt;
}

// Of a member that must be there. Throws what std::exception catches, as at() and get() do.
template <typename T>
T IntegerAt(const nlohmann::json& json, const char* key) {
  const std::optional<T> value = IntegerOf<T>(json.at(key));
  if (!value) throw std::out_of_range(std::string(key) + " is " + json.at(key).dump() + ", not such an integer");
  return *value;
}

}  // namespace haustra::evaluate
