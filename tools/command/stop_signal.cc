#include "tools/command/stop_signal.h"

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstring>

#include "tools/exit_codes.h"

namespace haustra {
namespace {

std::atomic<bool> is_caught{false};
std::atomic<bool> is_stop_requested{false};
std::atomic<bool> is_requested_again{false};
char last_words[80];  // complete before a handler is there

void TakeSignal(int) {
  if (!is_caught) {
    // The program ends also when this cannot be written.
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, last_words, std::strlen(last_words));
    ::_exit(kExitStopped);
  }
  if (is_stop_requested.exchange(true)) is_requested_again.store(true);
}

void Handle(int signal, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;  // a frame that is being read is read to its end
  sigemptyset(&action.sa_mask);
  sigaction(signal, &action, nullptr);
}

bool IsIgnored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

void HandleSignals(const char* command) {
  // A terminal shows ^C where the cursor stands.
  std::snprintf(last_words, sizeof(last_words), "%shaustra %s: stopped\n", isatty(STDERR_FILENO) == 1 ? "\n" : "",
                command);
  Handle(SIGINT, TakeSignal);
  Handle(SIGTERM, TakeSignal);
  if (!IsIgnored(SIGHUP)) Handle(SIGHUP, TakeSignal);
  // Not ignored: a program that is started from here would inherit that.
  Handle(SIGPIPE, [](int) {});
}

const std::atomic<bool>& CatchStopSignals() {
  is_caught = true;
  return is_stop_requested;
}

const std::atomic<bool>& SecondStopSignal() { return is_requested_again; }

}  // namespace haustra
