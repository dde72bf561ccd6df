// The elements of a small XML file, flat and in the order of the file: enough for camera rigs, no entities, no
// namespaces. reentrant.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hal/core/status.h"

namespace haustra::capture::internal {

struct XmlElement {
  std::string name;
  std::vector<std::pair<std::string, std::string>> attributes;
  std::string text;  // directly inside it, comments left out
  int line = 0;      // of its opening tag, from 1

  // Empty when there is no such attribute.
  std::string Attribute(std::string_view attribute) const;
};

// kInvalidArgument: not well formed; the message begins with `path` and the line.
Result<std::vector<XmlElement>> ParseXml(const std::string& path, std::string_view text);

}  // namespace haustra::capture::internal
