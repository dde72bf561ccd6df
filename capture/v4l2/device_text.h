// Text in the structures of V4L2: it ends at a zero, or with its field.
#pragma once

#include <linux/types.h>

#include <cstring>
#include <string>

namespace haustra {

template <std::size_t N>
std::string DeviceText(const __u8 (&bytes)[N]) {
  const char* text = reinterpret_cast<const char*>(bytes);
  return {text, strnlen(text, N)};
}

}  // namespace haustra
