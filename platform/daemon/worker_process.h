// The supervisor's hold of its worker (worker.h): a process, its channel and its descriptor. thread-bound(the service
// thread, which must also be the one that starts it: the worker ends with that thread).
#pragma once

#include <sys/types.h>

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/core/status.h"
#include "platform/daemon/worker_channel.h"

namespace haustra {

// Starts a process, a child of this one, which finds `channel` at kWorkerChannel and no other descriptor but the three
// standard streams. The channel stays the caller's. kUnavailable.
using WorkerStarter = std::function<Result<pid_t>(int channel)>;

// By this program and these arguments.
WorkerStarter StarterOf(std::vector<std::string> arguments);

class WorkerProcess {
 public:
  // kUnavailable: the system gives no process or no descriptor.
  static Result<std::unique_ptr<WorkerProcess>> Start(const WorkerStarter& start);
  // Kills it and waits for its end, unless it was let go.
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // As the functions of worker_channel.h.
  Status Send(const WorkerRequest& request, std::span<const int> files) const {
    return SendRequest(channel_, request, files);
  }
  Result<WorkerReport> Receive() const { return ReceiveReport(channel_); }
  // Readable when there is a message or the channel has ended.
  int channel() const { return channel_; }
  // Readable when the process has ended.
  int process_descriptor() const { return process_; }
  pid_t pid() const { return pid_; }

  void Kill() const;
  // How it ended, "signal 9" or "exit code 0"; nothing while it runs.
  std::optional<std::string> Reap();
  // It hangs in the kernel and cannot be waited for: whoever inherits it reaps it.
  void LetGo() { has_ended_ = true; }

 private:
  WorkerProcess(pid_t pid, int process, int channel) : pid_(pid), process_(process), channel_(channel) {}

  pid_t pid_;
  int process_;
  int channel_;
  bool has_ended_ = false;
};

}  // namespace haustra
