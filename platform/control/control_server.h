// The daemon's end of the control socket (control_protocol.h). Never blocks: one descriptor says when there is
// something to do, and Serve does it in a bounded time.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/core/status.h"
#include "hal/core/time.h"
#include "platform/control/control_protocol.h"

namespace haustra {

struct ControlLimits {
  int max_clients = 16;
  int max_clients_per_user = 8;                    // so that one user's programs cannot keep all others out
  Duration idle_limit = std::chrono::seconds(30);  // a client that asks nothing for so long is disconnected
  bool only_looks = false;                         // requests that change anything are refused (kFailedPrecondition)
};

// Who asks, as the kernel says.
struct ControlPeer {
  pid_t pid = 0;
  uid_t uid = 0;
};

// thread-bound(the service thread).
class ControlServer {
 public:
  using ClientId = std::uint64_t;
  // The answer, or nothing when it will come later, by Reply.
  using Handler =
      std::function<std::optional<Result<std::string>>(ClientId, const ControlPeer&, const ControlRequest&)>;

  // The socket appears under its name with its rights, ready; a stale one is replaced. `group`: -1 leaves the
  // caller's. kNotFound: no such folder; kInvalidArgument: the path is too long for a socket; kUnavailable: others.
  static Result<std::unique_ptr<ControlServer>> Create(const std::string& path, mode_t mode, gid_t group,
                                                       const ControlLimits& limits, Handler handler);
  // Disconnects all clients and removes the name.
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  // Readable when Serve has something to do.
  int descriptor() const { return epoll_; }
  // At most one request of each client. Also to be called now and then for the idle limit.
  void Serve(TimePoint now);
  // The answer to a request that was put off; nothing happens when the client has gone.
  void Reply(ClientId client, const Result<std::string>& reply, TimePoint now);

  // Whether the client still has its end open; false for one that was disconnected.
  bool IsThere(ClientId client) const;

  int num_clients() const { return static_cast<int>(clients_.size()); }
  std::uint64_t num_refused() const { return num_refused_; }  // clients above a limit
  std::uint64_t num_malformed() const { return num_malformed_; }

 private:
  struct Client {
    int socket = -1;
    ControlPeer peer;
    TimePoint last_active;
    bool is_waiting = false;  // for an answer that was put off
  };

  ControlServer(std::string path, int listener, int epoll, const ControlLimits& limits, Handler handler);
  void Accept(TimePoint now);
  void Receive(ClientId id, TimePoint now);
  void Send(ClientId id, const Result<std::string>& reply);
  void Disconnect(ClientId id);

  std::string path_;
  int listener_;
  int epoll_;
  ControlLimits limits_;
  Handler handler_;
  std::map<ClientId, Client> clients_;
  ClientId next_client_ = 1;  // 0: the listener
  std::uint64_t num_refused_ = 0;
  std::uint64_t num_malformed_ = 0;
};

}  // namespace haustra
