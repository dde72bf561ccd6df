// How a map is named among the files of a run, and of what is made from one.
#pragma once

#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <string>

namespace haustra {

// "map_0007"
inline std::string MapName(std::int64_t map_id) {
  char name[32];
  std::snprintf(name, sizeof name, "map_%04" PRId64, map_id);
  return name;
}

}  // namespace haustra
