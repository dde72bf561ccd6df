// Runs a program as a user would: arguments, two output streams, exit code, signals. thread-bound(the test).
#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

#include "tests/sanitized.h"

namespace haustra::end_to_end {

struct CommandResult {
  int exit_code = -1;      // -1: ended by a signal, or had to be killed
  int signal = 0;          // that ended it; 0: none
  bool timed_out = false;  // was killed because it did not end
  std::string out;
  std::string err;

  // For failure messages: how it ended and what it said.
  std::string ToString() const;
};

// A program that runs in the background, standard streams in temporary files. Killed when it goes out of scope.
class Command {
 public:
  // Starts at once; arguments[0] is the path of the program.
  explicit Command(const std::vector<std::string>& arguments);
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  bool IsRunning();
  pid_t pid() const { return pid_; }
  void Signal(int signal);
  // Waits until it ends; after `limit` it is killed, so that a hang fails a test and does not stop it.
  CommandResult Wait(std::chrono::seconds limit);

 private:
  bool Reap(int flags);

  pid_t pid_ = -1;
  bool has_ended_ = false;
  int wait_status_ = 0;
  int out_file_ = -1;
  int err_file_ = -1;
};

// The `haustra` of this build, until it ends.
CommandResult Haustra(const std::vector<std::string>& arguments);
// With --device cpu: what is compared to the bit, or in the time that it takes, is the same on every machine.
CommandResult HaustraOnCpu(std::vector<std::string> arguments);
std::vector<std::string> HaustraCommand(const std::vector<std::string>& arguments);

// Long enough for any run of these tests under any sanitizer on a busy machine.
inline constexpr std::chrono::seconds kHangLimit{test::kIsSanitized ? 3600 : 600};

}  // namespace haustra::end_to_end
