#include "platform/daemon/health.h"

#include <algorithm>
#include <cstdio>

namespace haustra {

TimePoint SignOfThread(const Heartbeat& beat, TimePoint now, Duration work_limit) {
  const bool has_begun = beat.count() > 1;
  return has_begun || now - beat.last() > work_limit ? beat.last() : now;
}

TimePoint SignOfCapture(TimePoint last, std::optional<TimePoint> recovering_since, TimePoint now, Duration work_limit) {
  if (!recovering_since) return last;
  return now - *recovering_since > work_limit ? std::max(last, *recovering_since) : now;
}

std::string FindHang(const SignsOfLife& signs, TimePoint now, const WatchdogConfig& limits) {
  const struct {
    const char* name;
    TimePoint last;
    int limit_ms;
  } threads[] = {{"tracking", signs.tracking, limits.tracking_limit_ms},
                 {"capture", signs.capture, limits.capture_limit_ms},
                 {"mapping", signs.mapping, limits.mapping_limit_ms},
                 {"merging", signs.merging, limits.mapping_limit_ms}};
  for (const auto& thread : threads) {
    const Duration silence = now - thread.last;
    if (silence <= std::chrono::milliseconds(thread.limit_ms)) continue;
    char text[64];
    std::snprintf(text, sizeof text, "%s thread hangs for %.1f s", thread.name, ToSeconds(silence));
    return text;
  }
  return "";
}

}  // namespace haustra
