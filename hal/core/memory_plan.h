// What a configuration costs in memory, pool by pool, before anything is taken. Each component adds its own lines, by
// the same arithmetic with which it allocates; `haustra plan` prints them. Plain data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

enum class MemoryPlace : std::uint8_t {
  kHostArena,   // in the one host arena
  kHostPinned,  // in the one block that host and accelerator share
  kHost,        // other host memory, fixed or bounded as the line says
  kDevice,      // in the one block of an accelerator
};

struct MemoryLine {
  std::string pool;         // "map points"
  std::uint64_t count = 0;  // entries
  std::uint64_t bytes = 0;
  std::string sized_by;  // keys of the configuration, or what else: "memory.max_map_points"
  MemoryPlace place = MemoryPlace::kHostArena;
};

struct MemoryPlan {
  std::vector<MemoryLine> lines;

  void Add(MemoryPlace place, std::string pool, std::uint64_t count, std::uint64_t bytes, std::string sized_by) {
    lines.push_back({std::move(pool), count, bytes, std::move(sized_by), place});
  }
  void Append(const MemoryPlan& other) { lines.insert(lines.end(), other.lines.begin(), other.lines.end()); }

  std::uint64_t bytes(MemoryPlace place) const {
    std::uint64_t sum = 0;
    for (const MemoryLine& line : lines) sum += line.place == place ? line.bytes : 0;
    return sum;
  }
  std::uint64_t host_bytes() const {
    return bytes(MemoryPlace::kHostArena) + bytes(MemoryPlace::kHostPinned) + bytes(MemoryPlace::kHost);
  }
  std::uint64_t device_bytes() const { return bytes(MemoryPlace::kDevice); }
};

// Limits in megabytes (10^6 bytes), 0: none. `host_limit` and `device_limit` name where a limit comes from.
struct MemoryLimits {
  double host_mb = 0.0;
  double device_mb = 0.0;
  std::string host_limit;
  std::string device_limit;
};

// kCapacityExceeded when the plan is larger: the message names the first line that does not fit and what sizes it.
Status CheckFits(const MemoryPlan& plan, const MemoryLimits& limits);

}  // namespace haustra
