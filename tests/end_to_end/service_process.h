// haustrad as a process with a service manager that is a script: the test. thread-bound(the test).
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "platform/control/control_client.h"
#include "tests/end_to_end/command.h"

namespace haustra::end_to_end {

class ServiceProcess {
 public:
  // `folder` is the test's own; the state folder is made in it. The runtime folder has a short path, as sockets need.
  explicit ServiceProcess(const std::string& folder);
  ~ServiceProcess();
  ServiceProcess(const ServiceProcess&) = delete;
  ServiceProcess& operator=(const ServiceProcess&) = delete;

  // Starts it; `prefix` is what runs it, for example a shell with limits.
  void Start(const std::vector<std::string>& arguments, const std::vector<std::string>& prefix = {});
  Command& command() { return *command_; }
  CommandResult Wait() { return command_->Wait(kHangLimit); }

  // Messages to the service manager since then no longer count.
  void ForgetMessages();
  bool HasSaid(const std::string& line);
  // False when the process ends first, or nothing comes for a long time.
  bool WaitForMessage(const std::string& line);
  // Until `status` has this line.
  bool WaitForStatus(const std::string& line);

  // A request over a new connection; "error: ..." when it is refused.
  std::string Ask(const std::string& request);
  std::string Status() { return Ask("status"); }
  // Value of a line of the status, empty when there is none.
  std::string StatusValue(const std::string& key);

  pid_t pid();
  // Of its worker, which does the work of one procedure; 0: none now.
  pid_t worker_pid();
  std::string state_folder() const { return folder_ + "/state"; }
  std::string runtime_folder() const { return runtime_folder_; }

 private:
  std::string folder_;
  std::string runtime_folder_;
  int socket_ = -1;
  std::unique_ptr<Command> command_;
  // A manager that does not read holds up the service: a thread does nothing else.
  void Listen();
  std::thread listener_;
  std::atomic<bool> is_ending_{false};
  std::mutex mutex_;
  std::vector<std::string> messages_;  // a line each
};

}  // namespace haustra::end_to_end
