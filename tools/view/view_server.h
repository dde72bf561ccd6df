// Serves a page to browsers on this machine, and a stream of news to those that have it open (server-sent events).
// It listens on 127.0.0.1 only, answers what request_gate.h admits, and reads no file by a name from a request.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "hal/core/status.h"

namespace haustra::view {

struct ViewResource {
  std::string content_type;
  std::string bytes;
};

// What one viewer is told. thread-bound(the viewer's thread of the server).
class ViewStream {
 public:
  virtual ~ViewStream() = default;
  // What is new since the last call, as text of an event stream; empty: nothing. Asked ten times a second.
  virtual std::string Next() = 0;
};

struct ViewSite {
  std::map<std::string, ViewResource, std::less<>> resources;  // by name; "" is the page
  // What changes while it is served, by name; null: there is nothing now. May be empty. thread-safe.
  std::function<std::shared_ptr<const ViewResource>(std::string_view name)> find;
  // Makes the stream of one more viewer, "live" in the address; may be empty. thread-safe.
  std::function<std::unique_ptr<ViewStream>()> open_stream;
  // Does what a viewer asks for, and answers with a text for people: POST "do?request=TEXT". May be empty: then nothing
  // can be changed here. thread-safe.
  std::function<Result<std::string>(std::string_view request)> change;
};

struct ViewServerOptions {
  int port = 0;       // 0: a free one
  std::string token;  // request_gate.h
};

// Streams at the same time; one more is answered with 503.
inline constexpr int kMaxViewers = 12;

// thread-bound(its owner), but for the stream that it opens.
class ViewServer {
 public:
  // kUnavailable: the port is taken, or cannot be had. kFailedPrecondition: the program was built without cpp-httplib.
  static Result<std::unique_ptr<ViewServer>> Start(ViewSite site, const ViewServerOptions& options);

  // Ends all streams and waits for their threads, a fraction of a second.
  virtual ~ViewServer() = default;

  virtual int port() const = 0;
  // "http://127.0.0.1:PORT/TOKEN/"
  virtual const std::string& address() const = 0;
};

}  // namespace haustra::view
