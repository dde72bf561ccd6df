// Joins text for messages.
#pragma once

#include <string>
#include <string_view>

namespace haustra::capture::internal {

template <typename... Parts>
std::string Concat(const Parts&... parts) {
  std::string text;
  (text.append(std::string_view(parts)), ...);
  return text;
}

}  // namespace haustra::capture::internal
