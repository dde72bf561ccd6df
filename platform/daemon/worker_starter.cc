#include "platform/daemon/worker_starter.h"

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <utility>

#include "hal/core/errno_text.h"
#include "platform/daemon/worker.h"

namespace haustra {
namespace {

// Less than the service manager waits for a sign of life of the thread that asks.
constexpr std::chrono::milliseconds kStarterPatience{1000};

// The number of a request and the channel go down, the number and this come up.
struct Answer {
  std::uint32_t request = 0;
  std::int32_t pid = 0;  // of the process, or -errno
};

bool SendChannel(int socket, std::uint32_t request, int channel) {
  iovec part{&request, sizeof request};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(header), &channel, sizeof channel);
  return ::sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT) == sizeof request;
}

// -1: none came. `is_over`: nobody will ask any more.
int ReceiveChannel(int socket, std::uint32_t* request, bool* is_over) {
  iovec part{request, sizeof *request};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t count = ::recvmsg(socket, &message, MSG_CMSG_CLOEXEC);
  *is_over = count == 0 || (count < 0 && errno != EINTR);
  const cmsghdr* header = count == sizeof *request ? CMSG_FIRSTHDR(&message) : nullptr;
  if (header == nullptr || header->cmsg_type != SCM_RIGHTS || header->cmsg_len != CMSG_LEN(sizeof(int))) return -1;
  int channel = -1;
  std::memcpy(&channel, CMSG_DATA(header), sizeof channel);
  return channel;
}

// In the new process, which has one thread and what the starter had: system calls only.
[[noreturn]] void BecomeProgram(int channel, char* const* words) {
  // A descriptor that has this number already would stay closed on exec; the copy of a copy does not.
  const int copy = ::fcntl(channel, F_DUPFD, kWorkerChannel + 1);
  if (copy < 0 || ::dup2(copy, kWorkerChannel) < 0) ::_exit(126);
  ::close(copy);
  ::execv(words[0], words);
  ::_exit(127);
}

[[noreturn]] void Serve(int socket, const std::vector<std::string>& arguments) {
  ::prctl(PR_SET_NAME, "haustrad-start", 0, 0, 0);
  std::vector<char*> words;
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  for (bool is_over = false; !is_over;) {
    Answer answer;
    const int channel = ReceiveChannel(socket, &answer.request, &is_over);
    if (channel < 0) continue;
    // A child of the supervisor, which reaps it and with which it ends.
    const long pid = ::syscall(SYS_clone, CLONE_PARENT | SIGCHLD, 0, 0, 0, 0);  // NOLINT(google-runtime-int)
    if (pid == 0) BecomeProgram(channel, words.data());
    answer.pid = pid > 0 ? static_cast<std::int32_t>(pid) : -errno;
    ::close(channel);
    (void)::send(socket, &answer, sizeof answer, MSG_NOSIGNAL);
  }
  ::_exit(0);
}

}  // namespace

Result<std::unique_ptr<ForkedStarter>> ForkedStarter::Fork(const std::vector<std::string>& arguments) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    return Unavailable("no socket for the starter: " + ErrnoText(errno));
  }
  const pid_t pid = ::fork();
  if (pid == 0) {
    ::close(ends[0]);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0);
    Serve(ends[1], arguments);
  }
  const int error = errno;
  ::close(ends[1]);
  if (pid > 0) return std::unique_ptr<ForkedStarter>(new ForkedStarter(pid, ends[0]));
  ::close(ends[0]);
  return Unavailable("no process for the starter: " + ErrnoText(error));
}

ForkedStarter::~ForkedStarter() {
  ::close(socket_);
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

Result<pid_t> ForkedStarter::Start(int channel) {
  ++request_;
  if (!SendChannel(socket_, request_, channel)) return Unavailable("the starter of workers has gone");
  const auto end = std::chrono::steady_clock::now() + kStarterPatience;
  Answer answer;
  // What it answers to an earlier request, when that has been given up, is of a worker that ends with its channel.
  while (answer.request != request_) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    pollfd answered{socket_, POLLIN, 0};
    const int count = ::poll(&answered, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (count < 0 && errno == EINTR) continue;
    if (count != 1 || ::recv(socket_, &answer, sizeof answer, MSG_DONTWAIT) != static_cast<ssize_t>(sizeof answer)) {
      return Unavailable("the starter of workers does not answer");
    }
  }
  if (answer.pid <= 0) return Unavailable("no worker can be started: " + ErrnoText(-answer.pid));
  return static_cast<pid_t>(answer.pid);
}

}  // namespace haustra
