#include "hal/frame_source.h"

#include <cstdio>

namespace haustra {

std::string NumberedFrameName(std::uint32_t number) {
  char name[32];
  std::snprintf(name, sizeof(name), "frame_%06u.png", static_cast<unsigned>(number));
  return name;
}

}  // namespace haustra
