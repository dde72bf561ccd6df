// What the service manager is told (sd_notify), and how often it wants to hear. Without libsystemd in the build, or
// without a manager, nothing is said. thread-bound(the service thread).
#pragma once

#include <string>

#include "hal/core/time.h"

namespace haustra {

class ServiceNotifier {
 public:
  ServiceNotifier();

  void Ready(const std::string& status);
  void Status(const std::string& status);  // says it only when it changed
  void Reloading();                        // Ready must follow
  void Stopping(const std::string& status);
  // Zero: nobody watches. Else the limit after which the manager takes the service for dead.
  Duration watchdog_limit() const { return watchdog_limit_; }
  void FeedWatchdog();

 private:
  Duration watchdog_limit_{0};
  std::string status_;
};

}  // namespace haustra
