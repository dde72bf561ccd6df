// The requests of a browser, and those that none would send, byte for byte. thread-bound(the test).
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <string>

namespace haustra::view {

// A connection to a server on this machine; closed when it goes out of scope.
class Connection {
 public:
  explicit Connection(int port, const char* address = "127.0.0.1") : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    ::inet_pton(AF_INET, address, &to.sin_addr);
    timeval limit{20, 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    is_open_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  bool is_open() const { return is_open_; }
  void Send(const std::string& text) const {
    EXPECT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  // All that comes until `mark` has come; what came so far when the other side closes or is silent for 20 s.
  std::string ReadUntil(const std::string& mark) {
    while (read_.find(mark) == std::string::npos && ReadMore()) {
    }
    return read_;
  }
  std::string ReadAll() {
    while (ReadMore()) {
    }
    return read_;
  }

 private:
  bool ReadMore() {
    char buffer[4096];
    const ssize_t count = ::recv(socket_, buffer, sizeof buffer, 0);
    if (count <= 0) return false;
    read_.append(buffer, static_cast<std::size_t>(count));
    return true;
  }

  int socket_;
  bool is_open_ = false;
  std::string read_;
};

inline std::string Host(int port) { return "Host: 127.0.0.1:" + std::to_string(port) + "\r\n"; }

// The whole answer to one request. `headers` end with a line break each.
inline std::string Ask(int port, const std::string& target, const std::string& headers,
                       const std::string& method = "GET") {
  Connection connection(port);
  EXPECT_TRUE(connection.is_open());
  connection.Send(method + " " + target + " HTTP/1.1\r\n" + headers + "Connection: close\r\n\r\n");
  return connection.ReadAll();
}

inline int StatusOf(const std::string& answer) {
  return answer.starts_with("HTTP/1.1 ") ? std::stoi(answer.substr(9, 3)) : 0;
}

}  // namespace haustra::view
