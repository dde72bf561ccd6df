// A YAML map that is read strictly: every value is looked up by a named key, and every error says file, line and key.
// Value type, reentrant. yaml-cpp's exceptions end here.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "hal/core/status.h"

namespace haustra::capture::internal {

class YamlMap {
 public:
  // The file's top-level map. A first line `%YAML:1.0`, as OpenCV writes it, is not YAML but is let through.
  // kInvalidArgument: a syntax error, not a map, a key that comes twice, or more than 500 keys in one map.
  static Result<YamlMap> Parse(const std::string& path, std::string text);

  // Only these keys may be there; the message suggests the nearest of them.
  Status RequireKnown(const std::vector<std::string_view>& known) const;
  // For formats of others, which may carry any key of their own: a key that nearly is one of `known`, which is itself
  // missing, is taken as a misspelling.
  Status RequireNoMisspelling(const std::vector<std::string_view>& known) const;

  bool Has(std::string_view key) const { return Find(key) != nullptr; }
  bool HasAny(std::initializer_list<std::string_view> keys) const;
  bool HasPrefix(std::string_view prefix) const;
  // In the order of the file.
  std::vector<std::string> Keys() const;
  // "calib.yaml:7: 'Camera.fx'"; without the line when the key is not there.
  std::string Where(std::string_view key) const;

  // kInvalidArgument: no such key, no value, or not what is asked for.
  Result<double> Number(std::string_view key) const;
  Result<std::int64_t> IntegerIn(std::string_view key, std::int64_t min, std::int64_t max) const;
  Result<std::string> Text(std::string_view key) const;
  Result<std::vector<double>> Numbers(std::string_view key) const;
  Result<YamlMap> Map(std::string_view key) const;

 private:
  struct Entry {
    std::string key;
    YAML::Node value;
    int line = 0;  // of the key, 1 for the first line of the file
  };

  static Result<YamlMap> FromNode(std::string path, std::string prefix, const YAML::Node& node, int line);
  const Entry* Find(std::string_view key) const;
  Result<std::string> Scalar(std::string_view key) const;

  std::string path_;
  std::string prefix_;  // of keys in messages: "intrinsics." inside that map
  int line_ = 0;        // where the map begins
  std::vector<Entry> entries_;
};

bool IsOneOf(std::string_view word, std::initializer_list<std::string_view> words);

// The entry of `candidates` that `word` is most likely a misspelling of; empty when none is near.
std::string_view NearestWord(std::string_view word, const std::vector<std::string_view>& candidates);

}  // namespace haustra::capture::internal
