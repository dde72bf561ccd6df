// Starts the workers of a supervisor that has given its own rights away, which a child would inherit. A process of its
// own, forked before that and before anything is known of a patient. It does nothing else, and ends with the
// supervisor. thread-bound(the thread that makes it, which must live as long as the workers).
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

class ForkedStarter {
 public:
  // The only thread of the process calls this. `arguments`: the program and what follows its name. kUnavailable.
  static Result<std::unique_ptr<ForkedStarter>> Fork(const std::vector<std::string>& arguments);
  // Ends it.
  ~ForkedStarter();
  ForkedStarter(const ForkedStarter&) = delete;
  ForkedStarter& operator=(const ForkedStarter&) = delete;

  // As WorkerStarter (worker_process.h): the worker is a child of this process, not of the starter. Waits for the
  // starter, which has nothing else to do, for a second at most. kUnavailable.
  Result<pid_t> Start(int channel);

 private:
  ForkedStarter(pid_t pid, int socket) : pid_(pid), socket_(socket) {}

  pid_t pid_;
  int socket_;
  std::uint32_t request_ = 0;  // the last one
};

}  // namespace haustra
