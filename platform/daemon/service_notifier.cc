#include "platform/daemon/service_notifier.h"

#include <cstdint>
#include <ctime>

#ifdef HAUSTRA_HAVE_SYSTEMD
#include <systemd/sd-daemon.h>
#endif

namespace haustra {
namespace {

void Notify([[maybe_unused]] const std::string& message) {
#ifdef HAUSTRA_HAVE_SYSTEMD
  // The service goes on when the manager cannot be told.
  (void)::sd_notify(0, message.c_str());
#endif
}

}  // namespace

ServiceNotifier::ServiceNotifier() {
#ifdef HAUSTRA_HAVE_SYSTEMD
  std::uint64_t limit_us = 0;
  if (::sd_watchdog_enabled(0, &limit_us) > 0) watchdog_limit_ = std::chrono::microseconds(limit_us);
#endif
}

void ServiceNotifier::Ready(const std::string& status) {
  status_ = status;
  Notify("READY=1\nSTATUS=" + status);
}

void ServiceNotifier::Status(const std::string& status) {
  if (status == status_) return;
  status_ = status;
  Notify("STATUS=" + status);
}

void ServiceNotifier::Reloading() {
  // The time stamp is what Type=notify-reload (systemd 253 and later) waits for; older ones ignore it.
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  const std::int64_t now_us = std::int64_t{now.tv_sec} * 1000000 + now.tv_nsec / 1000;
  Notify("RELOADING=1\nMONOTONIC_USEC=" + std::to_string(now_us));
}

void ServiceNotifier::Stopping(const std::string& status) { Notify("STOPPING=1\nSTATUS=" + status); }

void ServiceNotifier::FeedWatchdog() { Notify("WATCHDOG=1"); }

}  // namespace haustra
