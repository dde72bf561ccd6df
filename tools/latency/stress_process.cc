#include "tools/latency/stress_process.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>

#include "hal/core/errno_text.h"
#include "tools/latency/stress.h"

extern char** environ;

namespace haustra {
namespace {

// Both ends close when the program is replaced.
struct Pipe {
  Pipe() { is_open = ::pipe2(ends, O_CLOEXEC) == 0; }
  ~Pipe() {
    CloseEnd(0);
    CloseEnd(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void CloseEnd(int end) {
    if (ends[end] >= 0) ::close(ends[end]);
    ends[end] = -1;
  }
  int ends[2] = {-1, -1};  // to read from, to write to
  bool is_open = false;
};

// False: it has ended.
bool ReadByte(int descriptor) {
  char byte = 0;
  ssize_t count = -1;
  do count = ::read(descriptor, &byte, 1);
  while (count < 0 && errno == EINTR);
  return count == 1;
}

}  // namespace

Result<std::unique_ptr<StressProcess>> StressProcess::Start(const std::vector<std::string>& arguments) {
  std::vector<std::string> texts = {"haustra"};
  texts.insert(texts.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  Pipe input, output;
  if (!input.is_open || !output.is_open) return Unavailable("a second process: no pipe");
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, input.ends[0], STDIN_FILENO);
  ::posix_spawn_file_actions_adddup2(&actions, output.ends[1], STDOUT_FILENO);
  pid_t process = -1;
  const int error = ::posix_spawn(&process, "/proc/self/exe", &actions, nullptr, pointers.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return Unavailable("a second process: " + ErrnoText(error));
  output.CloseEnd(1);
  std::unique_ptr<StressProcess> started(new StressProcess(process, input.ends[1]));
  input.ends[1] = -1;
  if (!ReadByte(output.ends[0])) return Unavailable("the second process ended before it had a device");
  return started;
}

StressProcess::~StressProcess() {
  ::close(input_);
  while (::waitpid(process_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void OccupyUntilInputEnds(std::unique_ptr<VisionDevice> device) {
  const Stress load({}, std::move(device));
  if (::write(STDOUT_FILENO, "\n", 1) != 1) return;
  while (ReadByte(STDIN_FILENO)) {
  }
}

}  // namespace haustra
