#include "tools/command/stop_signal.h"

#include <signal.h>

#include <atomic>

namespace haustra {
namespace {

std::atomic<bool> is_stop_requested{false};

}  // namespace

const std::atomic<bool>& CatchStopSignals() {
  struct sigaction request {};
  request.sa_handler = [](int) { is_stop_requested.store(true); };
  request.sa_flags = SA_RESTART;  // a frame that is being read is read to its end
  sigemptyset(&request.sa_mask);
  sigaction(SIGINT, &request, nullptr);
  sigaction(SIGTERM, &request, nullptr);
  return is_stop_requested;
}

}  // namespace haustra
