#include "tools/plan/plan_text.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace haustra {
namespace {

const char* PlaceName(MemoryPlace place) {
  switch (place) {
    case MemoryPlace::kHostArena: return "host arena";
    case MemoryPlace::kHostPinned: return "host pinned";
    case MemoryPlace::kHost: return "host";
    case MemoryPlace::kDevice: return "device";
  }
  return "unknown";
}

double Megabytes(std::uint64_t bytes) { return static_cast<double>(bytes) / 1e6; }

}  // namespace

std::string PlanText(const std::string& heading, const MemoryPlan& plan) {
  std::string text = heading + "\n";
  char line[256];
  const auto add = [&](const char* place, const std::string& pool, const std::string& count, std::uint64_t bytes,
                       const std::string& sized_by) {
    std::snprintf(line, sizeof(line), "  %-11s %-22s %9s %10.2f MB%s%s\n", place, pool.c_str(), count.c_str(),
                  Megabytes(bytes), sized_by.empty() ? "" : "   ", sized_by.c_str());
    text += line;
  };
  for (const MemoryPlace place :
       {MemoryPlace::kHostArena, MemoryPlace::kHostPinned, MemoryPlace::kHost, MemoryPlace::kDevice}) {
    for (const MemoryLine& entry : plan.lines) {
      if (entry.place != place) continue;
      add(PlaceName(place), entry.pool, std::to_string(entry.count), entry.bytes, entry.sized_by);
    }
  }
  add("host arena", "total", "", plan.bytes(MemoryPlace::kHostArena), "");
  add("host", "total, all kinds", "", plan.host_bytes(), "");
  add("device", "total", "", plan.device_bytes(), "");
  return text;
}

std::string PlanJson(const MemoryPlan& plan) {
  nlohmann::ordered_json json;
  json["lines"] = nlohmann::ordered_json::array();
  for (const MemoryLine& line : plan.lines) {
    json["lines"].push_back({{"pool", line.pool},
                             {"count", line.count},
                             {"bytes", line.bytes},
                             {"place", PlaceName(line.place)},
                             {"sized_by", line.sized_by}});
  }
  json["host_arena_bytes"] = plan.bytes(MemoryPlace::kHostArena);
  json["host_pinned_bytes"] = plan.bytes(MemoryPlace::kHostPinned);
  json["host_bytes"] = plan.host_bytes();
  json["device_bytes"] = plan.device_bytes();
  return json.dump(2) + "\n";
}

}  // namespace haustra
