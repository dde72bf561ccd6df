#include "tools/command/stop_signal.h"

#include <signal.h>

#include <atomic>

namespace haustra {
namespace {

std::atomic<bool> is_stop_requested{false};
std::atomic<bool> is_requested_again{false};

void TakeSignal(int) {
  if (is_stop_requested.exchange(true)) is_requested_again.store(true);
}

}  // namespace

const std::atomic<bool>& CatchStopSignals() {
  struct sigaction request {};
  request.sa_handler = TakeSignal;
  request.sa_flags = SA_RESTART;  // a frame that is being read is read to its end
  sigemptyset(&request.sa_mask);
  sigaction(SIGINT, &request, nullptr);
  sigaction(SIGTERM, &request, nullptr);
  return is_stop_requested;
}

const std::atomic<bool>& SecondStopSignal() { return is_requested_again; }

}  // namespace haustra
