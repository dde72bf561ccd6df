// The other end of the control socket, for the command line and for tests. thread-bound(its owner).
#pragma once

#include <string>

#include "hal/core/status.h"
#include "hal/core/time.h"
#include "platform/control/control_protocol.h"

namespace haustra {

class ControlClient {
 public:
  // Never waits. kNotFound: there is no such socket, so no daemon; kUnavailable: no right to use it, nobody listens, or
  // who listens lets nobody in.
  static Result<ControlClient> Connect(const std::string& path);
  ControlClient(ControlClient&& other) noexcept;
  ControlClient& operator=(ControlClient&&) = delete;
  ~ControlClient();

  // Sends any bytes as one packet and waits for the answer. Errors: as ParseReply; kUnavailable: the daemon has gone,
  // put this client out or leaves its requests unread; kDeadlineExceeded.
  Result<std::string> Ask(std::string_view packet, Duration limit);
  Result<std::string> Ask(const ControlRequest& request, Duration limit) { return Ask(ToText(request), limit); }

 private:
  explicit ControlClient(int socket) : socket_(socket) {}
  int socket_;
};

}  // namespace haustra
