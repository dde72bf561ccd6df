// What is said of a value of the rendered world that is not allowed.
#pragma once

#include <cstdio>
#include <string>

#include "hal/core/status.h"

namespace haustra::render {

// 27 and 0.1 as a person writes them.
inline std::string NumberText(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

// "breathing is 0.5, must be in [0, 0.15] of the radius".
inline Status OutOfRange(const std::string& name, double value, const std::string& range) {
  return InvalidArgument(name + " is " + NumberText(value) + ", must be in " + range);
}

}  // namespace haustra::render
