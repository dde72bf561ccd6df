#include "tools/view/view_server.h"

#include <httplib.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "tools/view/request_gate.h"

namespace haustra::view {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kStep{100};
// Between two signs of life of a stream without news: so long a viewer that has gone keeps its place.
constexpr int kStepsPerSign = 20;
// Streams keep a thread each; these are for everything else.
constexpr int kOtherThreads = 8;

class HttpViewServer final : public ViewServer {
 public:
  HttpViewServer(ViewSite site, const ViewServerOptions& options) : site_(std::move(site)), token_(options.token) {}

  Status Listen(int port) {
    // Not the library's own choice, by which two programs may share a port.
    server_.set_socket_options([](socket_t socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    server_.new_task_queue = [] { return new httplib::ThreadPool(kMaxViewers + kOtherThreads); };
    server_.set_payload_max_length(0);
    // One request a connection: the body of one, which is never read, would be taken for the next.
    server_.set_keep_alive_max_count(1);
    server_.set_keep_alive_timeout(2);
    // The page takes nothing from elsewhere, shows in no other page, and tells no other page its address.
    server_.set_default_headers(
        {{"Content-Security-Policy",
          "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
          "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
         {"Cache-Control", "no-store"},
         {"Referrer-Policy", "no-referrer"},
         {"X-Content-Type-Options", "nosniff"},
         {"Cross-Origin-Opener-Policy", "same-origin"},
         {"Cross-Origin-Resource-Policy", "same-origin"}});
    server_.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      Answer(request, response);
      return httplib::Server::HandlerResponse::Handled;
    });
    if (port == 0) {
      port_ = server_.bind_to_any_port("127.0.0.1");
    } else {
      port_ = server_.bind_to_port("127.0.0.1", port) ? port : -1;
    }
    if (port_ <= 0) {
      return Unavailable(port == 0 ? std::string("no port can be had on 127.0.0.1")
                                   : "port " + std::to_string(port) + " of 127.0.0.1 is taken, or not allowed");
    }
    gate_ = std::make_unique<RequestGate>(token_, port_);
    address_ = "http://127.0.0.1:" + std::to_string(port_) + "/" + token_ + "/";
    thread_ = std::thread([this] {
      server_.listen_after_bind();
      has_ended_ = true;
    });
    // Stopping what has not begun would do nothing.
    while (!server_.is_running() && !has_ended_) std::this_thread::sleep_for(milliseconds(1));
    return has_ended_ ? Unavailable("the server cannot listen on 127.0.0.1") : Status::Ok();
  }

  ~HttpViewServer() override {
    is_stopping_ = true;
    if (!thread_.joinable()) return;
    server_.stop();
    thread_.join();
  }

  int port() const override { return port_; }
  const std::string& address() const override { return address_; }

 private:
  static std::optional<std::string> Header(const httplib::Request& request, const char* name) {
    if (!request.has_header(name)) return std::nullopt;
    // Two of a kind: one might be looked at here and the other elsewhere.
    return request.get_header_value_count(name) == 1 ? request.get_header_value(name) : std::string("twice");
  }

  void Answer(const httplib::Request& request, httplib::Response& response) {
    const std::optional<std::string> host = Header(request, "Host"), origin = Header(request, "Origin"),
                                     fetch_site = Header(request, "Sec-Fetch-Site");
    RequestHead head;
    head.method = request.method;
    head.path = request.path;
    if (host) head.host = *host;
    if (origin) head.origin = *origin;
    if (fetch_site) head.fetch_site = *fetch_site;
    const std::optional<std::string_view> name = gate_->Admit(head);
    if (!name) return Refuse(403, "Not for you: the address is the one that haustra view has printed.\n", response);
    if (head.method == "POST") return Change(*name, request, response);
    if (*name == "live" && site_.open_stream) return Stream(response);
    std::shared_ptr<const ViewResource> resource;
    const auto found = site_.resources.find(*name);
    // Those of the site live as long as the server: no owner.
    if (found != site_.resources.end()) {
      resource = {std::shared_ptr<const ViewResource>(), &found->second};
    } else if (site_.find) {
      resource = site_.find(*name);
    }
    if (resource == nullptr) return Refuse(404, "There is nothing of this name.\n", response);
    response.status = 200;
    // The library takes no provider of zero bytes.
    if (resource->bytes.empty()) return response.set_content(std::string(), resource->content_type);
    // Not copied for a viewer.
    response.set_content_provider(resource->bytes.size(), resource->content_type,
                                  [resource](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
                                    return sink.write(resource->bytes.data() + offset, length);
                                  });
  }

  // The request stands in the address: a body is never read.
  void Change(std::string_view name, const httplib::Request& request, httplib::Response& response) {
    if (!site_.change || name != "do") return Refuse(404, "There is nothing here that can be changed.\n", response);
    const Result<std::string> done = site_.change(request.get_param_value("request"));
    if (!done.ok()) return Refuse(409, done.status().message().c_str(), response);
    response.set_content(*done, "text/plain; charset=utf-8");
    response.status = 200;
  }

  static void Refuse(int status, const char* text, httplib::Response& response) {
    response.status = status;
    response.set_content(text, "text/plain; charset=utf-8");
  }

  void Stream(httplib::Response& response) {
    if (++num_viewers_ > kMaxViewers) {
      --num_viewers_;
      return Refuse(503, "As many look on as can.\n", response);
    }
    const std::shared_ptr<ViewStream> stream = site_.open_stream();
    response.status = 200;
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, stream, steps = 0](std::size_t, httplib::DataSink& sink) mutable {
          if (is_stopping_) {
            sink.done();
            return true;
          }
          std::string news = stream->Next();
          if (news.empty() && ++steps % kStepsPerSign == 0) news = ":\n\n";
          if (!news.empty() && !sink.write(news.data(), news.size())) return false;
          std::this_thread::sleep_for(kStep);
          return true;
        },
        [this](bool) { --num_viewers_; });
  }

  ViewSite site_;
  std::string token_;
  std::string address_;
  int port_ = -1;
  std::unique_ptr<RequestGate> gate_;
  httplib::Server server_;
  std::thread thread_;
  std::atomic<bool> has_ended_{false};
  std::atomic<bool> is_stopping_{false};
  std::atomic<int> num_viewers_{0};
};

}  // namespace

Result<std::unique_ptr<ViewServer>> ViewServer::Start(ViewSite site, const ViewServerOptions& options) {
  auto server = std::make_unique<HttpViewServer>(std::move(site), options);
  HAUSTRA_TRY(server->Listen(options.port));
  return std::unique_ptr<ViewServer>(std::move(server));
}

}  // namespace haustra::view
