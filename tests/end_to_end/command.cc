#include "tests/end_to_end/command.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <thread>

namespace haustra::end_to_end {
namespace {

// An unnamed file: a pipe would have to be read while the program runs.
int OpenTemporary() {
  std::string pattern = testing::TempDir() + "haustra_stream_XXXXXX";
  const int file = mkstemp(pattern.data());
  EXPECT_GE(file, 0) << pattern;
  unlink(pattern.c_str());
  return file;
}

std::string ReadAll(int file) {
  std::string text;
  char buffer[4096];
  lseek(file, 0, SEEK_SET);
  for (ssize_t n; (n = read(file, buffer, sizeof(buffer))) > 0;) text.append(buffer, static_cast<std::size_t>(n));
  return text;
}

}  // namespace

std::string CommandResult::ToString() const {
  std::string text = timed_out ? "had to be killed" : signal != 0 ? "signal " + std::to_string(signal) : "";
  if (text.empty()) text = "exit code " + std::to_string(exit_code);
  return text + "\nstdout:\n" + out + "\nstderr:\n" + err;
}

Command::Command(const std::vector<std::string>& arguments) : out_file_(OpenTemporary()), err_file_(OpenTemporary()) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    dup2(out_file_, STDOUT_FILENO);
    dup2(err_file_, STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  EXPECT_GT(pid_, 0) << "fork failed";
}

Command::~Command() {
  if (IsRunning()) {
    kill(pid_, SIGKILL);
    Reap(0);
  }
  close(out_file_);
  close(err_file_);
}

bool Command::Reap(int flags) {
  if (!has_ended_ && waitpid(pid_, &wait_status_, flags) == pid_) has_ended_ = true;
  return has_ended_;
}

bool Command::IsRunning() { return !Reap(WNOHANG); }

void Command::Signal(int signal) {
  if (IsRunning()) kill(pid_, signal);
}

CommandResult Command::Wait(std::chrono::seconds limit) {
  CommandResult result;
  const auto end = std::chrono::steady_clock::now() + limit;
  while (IsRunning()) {
    if (std::chrono::steady_clock::now() > end) {
      kill(pid_, SIGKILL);
      Reap(0);
      result.timed_out = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  if (WIFEXITED(wait_status_)) result.exit_code = WEXITSTATUS(wait_status_);
  if (WIFSIGNALED(wait_status_)) result.signal = WTERMSIG(wait_status_);
  result.out = ReadAll(out_file_);
  result.err = ReadAll(err_file_);
  return result;
}

std::vector<std::string> HaustraCommand(const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {HAUSTRA_BINARY};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

CommandResult HaustraOnCpu(std::vector<std::string> arguments) {
  arguments.insert(arguments.end(), {"--device", "cpu"});
  return Haustra(arguments);
}

CommandResult Haustra(const std::vector<std::string>& arguments) {
  return Command(HaustraCommand(arguments)).Wait(kHangLimit);
}

}  // namespace haustra::end_to_end
