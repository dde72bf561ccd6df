#include "tools/command/stop_signal.h"

#include <atomic>
#include <csignal>

namespace haustra {
namespace {

std::atomic<bool> is_stop_requested{false};

}  // namespace

const std::atomic<bool>& CatchStopSignals() {
  const auto request = [](int) { is_stop_requested.store(true); };
  std::signal(SIGINT, request);
  std::signal(SIGTERM, request);
  return is_stop_requested;
}

}  // namespace haustra
