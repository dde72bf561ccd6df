// One row of a configuration table: a key, what values it takes, what it means, and the struct member that holds it.
// The default is the member's initialiser, so that a struct made in code and an empty file give the same configuration.
#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "hal/core/check.h"
#include "hal/core/status.h"

namespace haustra {

using ConfigValue = std::variant<bool, std::int64_t, double, std::string>;

enum class ConfigType { kBool, kInteger, kNumber, kChoice, kText };

// Whether a change takes effect while running, or at the next start (whatever sizes memory).
enum class ConfigReload { kLive, kRestart };

struct ConfigRange {
  double min = 0.0;  // inclusive
  double max = 0.0;  // inclusive; integers up to 2^53
};

struct ConfigField {
  std::string key;  // path joined by dots: "tracking.min_inliers"
  ConfigType type = ConfigType::kBool;
  ConfigRange range;                 // kInteger, kNumber
  std::vector<std::string> choices;  // kChoice
  std::string unit;                  // empty when it has none
  std::string description;
  ConfigReload reload = ConfigReload::kRestart;
  // `config` points to the struct that the table is bound to.
  ConfigValue (*read)(const void* config) = nullptr;
  void (*write)(void* config, const ConfigValue& value) = nullptr;

  // Reads a value as it stands in a file or on the command line. kFailedPrecondition: wrong type, not finite or out of
  // range; the message says what was found and what is allowed, without the key.
  Result<ConfigValue> Parse(std::string_view text, bool is_quoted) const;
  // "an integer from 100 to 8000", "true or false", "cpu or cuda".
  std::string Allowed() const;
};

// As it is written in a file; ConfigField::Parse gives the same value back to the bit.
std::string ToText(const ConfigValue& value);

namespace config {

template <typename T>
struct MemberPointer;
template <typename T, typename S>
struct MemberPointer<T S::*> {
  using Owner = S;
};

// The member at the end of a path of member pointers: kPath = &EngineConfig::noise, &NoiseConfig::k.
template <auto kFirst, auto... kRest>
struct Bound {
  using Config = typename MemberPointer<decltype(kFirst)>::Owner;
  // `C` is Config or const Config.
  template <typename C>
  static auto& Get(C& config) {
    return ((config.*kFirst).*....*kRest);
  }
};

}  // namespace config

// BindField<&EngineConfig::noise, &NoiseConfig::k>("noise.k", {0, 10}, "px per px", "...", ConfigReload::kLive): the
// path of members that leads to the value from the struct of the table. `range` is ignored for bool; strings are bound
// with BindChoice or BindText.
template <auto... kPath>
ConfigField BindField(std::string key, ConfigRange range, std::string unit, std::string description,
                      ConfigReload reload) {
  using Target = config::Bound<kPath...>;
  using Config = typename Target::Config;
  using Value = std::remove_reference_t<decltype(Target::Get(std::declval<Config&>()))>;
  ConfigField field{.key = std::move(key),
                    .range = range,
                    .choices = {},
                    .unit = std::move(unit),
                    .description = std::move(description),
                    .reload = reload};
  if constexpr (std::same_as<Value, bool>) {
    field.type = ConfigType::kBool;
    field.read = [](const void* c) { return ConfigValue(Target::Get(*static_cast<const Config*>(c))); };
    field.write = [](void* c, const ConfigValue& v) { Target::Get(*static_cast<Config*>(c)) = std::get<bool>(v); };
  } else if constexpr (std::integral<Value>) {
    field.type = ConfigType::kInteger;
    HAUSTRA_CHECK(std::in_range<Value>(static_cast<std::int64_t>(range.min)));
    HAUSTRA_CHECK(std::in_range<Value>(static_cast<std::int64_t>(range.max)));
    field.read = [](const void* c) {
      return ConfigValue(static_cast<std::int64_t>(Target::Get(*static_cast<const Config*>(c))));
    };
    field.write = [](void* c, const ConfigValue& v) {
      Target::Get(*static_cast<Config*>(c)) = static_cast<Value>(std::get<std::int64_t>(v));
    };
  } else {
    static_assert(std::same_as<Value, double>, "bool, an integer or double");
    field.type = ConfigType::kNumber;
    field.read = [](const void* c) { return ConfigValue(Target::Get(*static_cast<const Config*>(c))); };
    field.write = [](void* c, const ConfigValue& v) { Target::Get(*static_cast<Config*>(c)) = std::get<double>(v); };
  }
  return field;
}

// A std::string member that takes any printable text on one line, such as the name of a file.
template <auto... kPath>
ConfigField BindText(std::string key, std::string description, ConfigReload reload) {
  using Target = config::Bound<kPath...>;
  using Config = typename Target::Config;
  ConfigField field{.key = std::move(key),
                    .type = ConfigType::kText,
                    .range = {},
                    .choices = {},
                    .unit = {},
                    .description = std::move(description),
                    .reload = reload};
  field.read = [](const void* c) {
    return ConfigValue(std::in_place_type<std::string>, Target::Get(*static_cast<const Config*>(c)));
  };
  field.write = [](void* c, const ConfigValue& v) { Target::Get(*static_cast<Config*>(c)) = std::get<std::string>(v); };
  return field;
}

// A std::string member that takes one of a few names.
template <auto... kPath>
ConfigField BindChoice(std::string key, std::vector<std::string> choices, std::string description,
                       ConfigReload reload) {
  ConfigField field = BindText<kPath...>(std::move(key), std::move(description), reload);
  field.type = ConfigType::kChoice;
  field.choices = std::move(choices);
  return field;
}

}  // namespace haustra
