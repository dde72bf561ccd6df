#include "platform/control/control_client.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "hal/core/errno_text.h"

namespace haustra {

Result<ControlClient> ControlClient::Connect(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) return InvalidArgument(path + ": is too long for a socket");
  std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
  ControlClient client(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (client.socket_ < 0 ||
      ::connect(client.socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    if (error == ENOENT) return NotFound(path + ": no such socket; is haustrad running?");
    // As many wait as may: who should let them in hangs.
    if (error == EAGAIN) return Unavailable(path + ": haustrad takes no connections");
    return Unavailable(path + ": " + ErrnoText(error));
  }
  return client;
}

ControlClient::ControlClient(ControlClient&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

ControlClient::~ControlClient() {
  if (socket_ >= 0) ::close(socket_);
}

Result<std::string> ControlClient::Ask(std::string_view packet, Duration limit) {
  // A daemon that turns a client away says why before it is asked; so the answer is read even if sending fails.
  const ssize_t sent = ::send(socket_, packet.data(), packet.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  // Earlier requests lie there unread, so that no answer to this one will come.
  if (sent < 0 && errno == EAGAIN) return Unavailable("haustrad takes no requests");
  pollfd poll{socket_, POLLIN, 0};
  const auto end = std::chrono::steady_clock::now() + limit;
  int ready = -1;
  // A signal that does not end this process does not end the wait.
  do {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now()).count();
    ready = ::poll(&poll, 1, static_cast<int>(std::max<std::int64_t>(left, 0)));
  } while (ready < 0 && errno == EINTR);
  if (ready == 0) return Status(StatusCode::kDeadlineExceeded, "haustrad did not answer in time");
  std::vector<char> reply(kMaxReplyBytes);
  const ssize_t count = ready < 0 ? -1 : ::recv(socket_, reply.data(), reply.size(), 0);
  if (count > 0) return ParseReply({reply.data(), static_cast<std::size_t>(count)});
  if (sent < 0 || count < 0) return Unavailable("haustrad has gone: " + ErrnoText(errno));
  return Unavailable("haustrad closed the connection");
}

}  // namespace haustra
