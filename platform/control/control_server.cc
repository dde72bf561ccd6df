#include "platform/control/control_server.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "hal/core/errno_text.h"

namespace haustra {
namespace {

constexpr ControlServer::ClientId kListenerId = 0;

bool Watch(int epoll, int descriptor, ControlServer::ClientId id) {
  epoll_event event{};
  event.events = EPOLLIN | EPOLLRDHUP;
  event.data.u64 = id;
  return ::epoll_ctl(epoll, EPOLL_CTL_ADD, descriptor, &event) == 0;
}

}  // namespace

Result<std::unique_ptr<ControlServer>> ControlServer::Create(const std::string& path, mode_t mode, gid_t group,
                                                             const ControlLimits& limits, Handler handler) {
  const std::string temporary_path = path + ".new";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (temporary_path.size() >= sizeof address.sun_path) {
    return InvalidArgument(path + ": is too long for a socket (at most " + std::to_string(sizeof address.sun_path - 5) +
                           " bytes)");
  }
  std::memcpy(address.sun_path, temporary_path.c_str(), temporary_path.size() + 1);
  const int listener = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  const auto fail = [&](int error) {
    ::unlink(temporary_path.c_str());
    if (listener >= 0) ::close(listener);
    if (epoll >= 0) ::close(epoll);
    if (error == ENOENT || error == ENOTDIR) return NotFound(path + ": its folder does not exist");
    return Unavailable(path + ": cannot be created: " + ErrnoText(error));
  };
  if (listener < 0 || epoll < 0) return fail(errno);
  ::unlink(temporary_path.c_str());
  // Rights first, then the name that people know: nobody connects to a half-made socket.
  if (::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return fail(errno);
  if (group != static_cast<gid_t>(-1) && ::chown(temporary_path.c_str(), static_cast<uid_t>(-1), group) != 0) {
    return fail(errno);
  }
  if (::chmod(temporary_path.c_str(), mode) != 0 || ::listen(listener, limits.max_clients) != 0 ||
      !Watch(epoll, listener, kListenerId) || std::rename(temporary_path.c_str(), path.c_str()) != 0) {
    return fail(errno);
  }
  return std::unique_ptr<ControlServer>(new ControlServer(path, listener, epoll, limits, std::move(handler)));
}

ControlServer::ControlServer(std::string path, int listener, int epoll, const ControlLimits& limits, Handler handler)
    : path_(std::move(path)), listener_(listener), epoll_(epoll), limits_(limits), handler_(std::move(handler)) {}

ControlServer::~ControlServer() {
  for (const auto& [id, client] : clients_) ::close(client.socket);
  ::close(listener_);
  ::close(epoll_);
  ::unlink(path_.c_str());
}

void ControlServer::Serve(TimePoint now) {
  std::array<epoll_event, 32> events;
  const int num_events = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < num_events; ++i) {
    const ClientId id = events[static_cast<std::size_t>(i)].data.u64;
    if (id == kListenerId) {
      Accept(now);
    } else {
      Receive(id, now);
    }
  }
  std::vector<ClientId> expired;
  for (const auto& [id, client] : clients_) {
    if (!client.is_waiting && now - client.last_active > limits_.idle_limit) expired.push_back(id);
  }
  for (const ClientId id : expired) Disconnect(id);
}

void ControlServer::Accept(TimePoint now) {
  const int socket = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket < 0) return;
  ucred credentials{};
  socklen_t size = sizeof credentials;
  ControlPeer peer;
  if (::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &credentials, &size) == 0) {
    peer = {credentials.pid, credentials.uid};
  }
  const auto of_user = std::count_if(clients_.begin(), clients_.end(),
                                     [&](const auto& client) { return client.second.peer.uid == peer.uid; });
  const ClientId id = next_client_++;
  if (num_clients() >= limits_.max_clients || of_user >= limits_.max_clients_per_user || !Watch(epoll_, socket, id)) {
    ++num_refused_;
    const std::string reply = ReplyText(Unavailable("too many clients; try again later"));
    (void)::send(socket, reply.data(), reply.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    ::close(socket);
    return;
  }
  clients_[id] = {socket, peer, now, false};
}

void ControlServer::Receive(ClientId id, TimePoint now) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return;
  Client& client = it->second;
  std::array<char, kMaxRequestBytes + 1> packet;
  const ssize_t count = ::recv(client.socket, packet.data(), packet.size(), MSG_DONTWAIT | MSG_TRUNC);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
  // An empty packet looks like a closed connection, and nobody has reason to send one.
  if (count <= 0) return Disconnect(id);
  client.last_active = now;
  if (client.is_waiting) {
    ++num_malformed_;
    return Disconnect(id);  // one request at a time
  }
  // MSG_TRUNC: the length that it had, which may be more than what was kept.
  const std::size_t kept = std::min(static_cast<std::size_t>(count), packet.size());
  const Result<ControlRequest> request = ParseControlRequest({packet.data(), kept});
  if (!request.ok()) {
    ++num_malformed_;
    return Send(id, request.status());
  }
  if (limits_.only_looks && !OnlyLooks(request->command)) {
    return Send(id, FailedPrecondition("this socket answers status and metrics only; '" + std::string(kControlSocket) +
                                       "' beside it takes the rest"));
  }
  client.is_waiting = true;
  if (const std::optional<Result<std::string>> reply = handler_(id, client.peer, *request)) Reply(id, *reply, now);
}

void ControlServer::Reply(ClientId id, const Result<std::string>& reply, TimePoint now) {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return;
  it->second.is_waiting = false;
  it->second.last_active = now;
  Send(id, reply);
}

bool ControlServer::IsThere(ClientId id) const {
  const auto it = clients_.find(id);
  if (it == clients_.end()) return false;
  // It may have left since Serve looked.
  pollfd client{it->second.socket, POLLRDHUP, 0};
  return ::poll(&client, 1, 0) == 0;
}

void ControlServer::Send(ClientId id, const Result<std::string>& reply) {
  const std::string text = ReplyText(reply);
  const ssize_t sent = ::send(clients_.at(id).socket, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  // One that does not read its answers gets no more of them.
  if (sent != static_cast<ssize_t>(text.size())) Disconnect(id);
}

void ControlServer::Disconnect(ClientId id) {
  ::close(clients_.at(id).socket);
  clients_.erase(id);
}

}  // namespace haustra
