#include "hal/core/memory_plan.h"

#include <cstdio>

namespace haustra {
namespace {

std::string Megabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}

Status CheckPlace(const MemoryPlan& plan, bool is_device, double limit_mb, const std::string& limit) {
  if (limit_mb <= 0.0) return Status::Ok();
  const std::uint64_t total = is_device ? plan.device_bytes() : plan.host_bytes();
  std::uint64_t sum = 0;
  for (const MemoryLine& line : plan.lines) {
    if ((line.place == MemoryPlace::kDevice) != is_device) continue;
    sum += line.bytes;
    if (static_cast<double>(sum) <= limit_mb * 1e6) continue;
    return CapacityExceeded(std::string(is_device ? "device" : "host") + " memory: '" + line.pool + "' (" +
                            Megabytes(line.bytes) + ", sized by " + line.sized_by + ") does not fit: the plan needs " +
                            Megabytes(total) + ", " + limit + " allows " +
                            Megabytes(static_cast<std::uint64_t>(limit_mb * 1e6)) + "; 'haustra plan' shows all lines");
  }
  return Status::Ok();
}

}  // namespace

Status CheckFits(const MemoryPlan& plan, const MemoryLimits& limits) {
  HAUSTRA_TRY(CheckPlace(plan, false, limits.host_mb, limits.host_limit));
  return CheckPlace(plan, true, limits.device_mb, limits.device_limit);
}

}  // namespace haustra
