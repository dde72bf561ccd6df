#include "platform/daemon/worker_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "hal/core/errno_text.h"
#include "platform/daemon/worker.h"

extern char** environ;

namespace haustra {

WorkerStarter StarterOf(std::vector<std::string> arguments) {
  return [arguments = std::move(arguments)](int channel) -> Result<pid_t> {
    std::vector<char*> words;
    for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
    words.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    // A descriptor that has this number already would stay closed on exec; the copy of a copy does not.
    ::posix_spawn_file_actions_adddup2(&actions, channel, kWorkerChannel + 1);
    ::posix_spawn_file_actions_adddup2(&actions, kWorkerChannel + 1, kWorkerChannel);
    ::posix_spawn_file_actions_addclose(&actions, kWorkerChannel + 1);
    // The signal mask goes along: a stop of the whole group of processes is the supervisor's to hear.
    pid_t pid = -1;
    const int error = ::posix_spawn(&pid, words[0], &actions, nullptr, words.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    if (error != 0) return Unavailable("no worker can be started: " + ErrnoText(error));
    return pid;
  };
}

Result<std::unique_ptr<WorkerProcess>> WorkerProcess::Start(const WorkerStarter& start) {
  HAUSTRA_ASSIGN(const ChannelPair channel, MakeChannel());
  const Result<pid_t> pid = start(channel.worker);
  ::close(channel.worker);
  if (!pid.ok()) {
    ::close(channel.supervisor);
    return pid.status();
  }
  const int process = static_cast<int>(::syscall(SYS_pidfd_open, *pid, 0));
  const int error = errno;
  std::unique_ptr<WorkerProcess> worker(new WorkerProcess(*pid, process, channel.supervisor));
  if (process < 0) return Unavailable("no descriptor of the worker: " + ErrnoText(error));
  ::fcntl(process, F_SETFD, FD_CLOEXEC);
  return worker;
}

WorkerProcess::~WorkerProcess() {
  if (!has_ended_) {
    Kill();
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
  }
  if (process_ >= 0) ::close(process_);
  ::close(channel_);
}

void WorkerProcess::Kill() const {
  // Not reaped yet: the number is still its own.
  if (!has_ended_) ::kill(pid_, SIGKILL);
}

std::optional<std::string> WorkerProcess::Reap() {
  if (has_ended_) return std::nullopt;
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
  has_ended_ = true;
  if (WIFSIGNALED(status)) return "signal " + std::to_string(WTERMSIG(status));
  return "exit code " + std::to_string(WEXITSTATUS(status));
}

}  // namespace haustra
