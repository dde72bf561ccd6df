// Who may see a page that is served on this machine: only who was told its address, and only as a page of its own.
//
// The address holds a token of 128 random bits. A web page from elsewhere does not know it. Should it leak, Host and
// Origin still tell such a page apart, also one whose name was made to point at this machine (DNS rebinding).
// reentrant.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra::view {

// 32 hexadecimal digits from the system's generator. kUnavailable: it gives none.
Result<std::string> MakeToken();

// A token that a file holds: 32 to 128 letters, digits, '-' or '_', blanks around it. kNotFound, kUnavailable: the
// file; kInvalidArgument: something else is in it; kFailedPrecondition: others than its owner may read it.
Result<std::string> ReadToken(const std::string& path);

// The head of a request as it came in; views of the caller's memory.
struct RequestHead {
  std::string_view method;
  std::string_view path;                       // without the part from '?' on
  std::string_view host;                       // header Host; empty: there is none, or more than one
  std::optional<std::string_view> origin;      // header Origin, where it was sent
  std::optional<std::string_view> fetch_site;  // header Sec-Fetch-Site, where it was sent
};

class RequestGate {
 public:
  RequestGate(std::string token, int port) : token_(std::move(token)), port_(port) {}

  // What is asked for: the path behind the token, empty for the page itself. Nothing: the request is refused. GET
  // looks, POST may change something: that one must name the page's own origin.
  std::optional<std::string_view> Admit(const RequestHead& request) const;

 private:
  std::string token_;
  int port_;
};

}  // namespace haustra::view
