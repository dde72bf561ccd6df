// The YAML subset that configuration files are written in: maps of maps and scalars, with comments. Lists, anchors,
// aliases, tags and several documents in one file are refused. Private to platform/config and its tests.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra::config {

// One scalar of the document. Line and column count from 1.
struct ConfigEntry {
  std::string key;  // path of keys joined by dots: "tracking.min_inliers"
  std::string value;
  bool is_quoted = false;  // then it is a string, whatever it looks like
  int key_line = 0, key_column = 0;
  int value_line = 0, value_column = 0;
};

// Entries in the order of the text. `name` stands for the file in messages. An empty document has no entries.
// Errors: kFailedPrecondition with name:line:column for text that is not in the subset, also for duplicate keys.
Result<std::vector<ConfigEntry>> ParseConfigText(std::string_view text, const std::string& name);

}  // namespace haustra::config
