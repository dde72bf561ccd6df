#include "tools/view/view_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "tests/tools/view/http_get.h"

namespace haustra::view {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kServerToken = "0123456789abcdef0123456789abcdef";
const std::string kRoot = std::string("/") + kServerToken + "/";

// Counts how often it was asked.
class CountingStream final : public ViewStream {
 public:
  explicit CountingStream(std::atomic<int>* num_open) : num_open_(num_open) { ++*num_open_; }
  ~CountingStream() override { --*num_open_; }
  std::string Next() override { return "data: " + std::to_string(++count_) + "\n\n"; }

 private:
  std::atomic<int>* num_open_;
  int count_ = 0;
};

class ViewServerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ViewSite site;
    site.resources[""] = {"text/html", "<p>page</p>"};
    site.resources["run.json"] = {"application/json", "{}"};
    site.resources["empty"] = {"text/plain", ""};
    site.find = [this](std::string_view name) { return name == "wall.ply" ? wall_ : nullptr; };
    site.open_stream = [this] { return std::make_unique<CountingStream>(&num_open_); };
    site.change = [this](std::string_view request) -> Result<std::string> {
      asked_ = request;
      if (request == "no") return FailedPrecondition("not now");
      return std::string("done\n");
    };
    Result<std::unique_ptr<ViewServer>> server = ViewServer::Start(std::move(site), {0, kServerToken});
    ASSERT_TRUE(server.ok()) << server.status().message();
    server_ = std::move(*server);
  }
  std::string Get(const std::string& target, const std::string& more = "") const {
    return Ask(server_->port(), target, Host(server_->port()) + more);
  }
  std::string Post(const std::string& target, const std::string& more = "") const {
    const std::string origin = "Origin: http://127.0.0.1:" + std::to_string(server_->port()) + "\r\n";
    return Ask(server_->port(), target, Host(server_->port()) + origin + "Content-Length: 0\r\n" + more, "POST");
  }
  void WaitForStreams(int number) const {
    for (int i = 0; i < 1000 && num_open_ != number; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    EXPECT_EQ(num_open_, number);
  }

  std::shared_ptr<const ViewResource> wall_;
  std::string asked_;  // of what can be changed
  std::atomic<int> num_open_{0};
  std::unique_ptr<ViewServer> server_;
};

TEST_F(ViewServerTest, GivesWhatItHasToWhoKnowsTheAddress) {
  EXPECT_EQ(server_->address(), "http://127.0.0.1:" + std::to_string(server_->port()) + kRoot);
  const std::string page = Get(kRoot);
  EXPECT_EQ(StatusOf(page), 200);
  EXPECT_TRUE(page.ends_with("<p>page</p>"));
  EXPECT_THAT(page, HasSubstr("Content-Type: text/html"));
  EXPECT_EQ(StatusOf(Get(kRoot + "run.json?x=1")), 200);
  EXPECT_EQ(StatusOf(Get(kRoot + "empty")), 200);
  EXPECT_EQ(StatusOf(Get(kRoot + "other")), 404);
}

TEST_F(ViewServerTest, WhatChangesIsAskedForEachTime) {
  EXPECT_EQ(StatusOf(Get(kRoot + "wall.ply")), 404);
  wall_ = std::make_shared<const ViewResource>(ViewResource{"text/plain", "one"});
  EXPECT_TRUE(Get(kRoot + "wall.ply").ends_with("one"));
  wall_ = std::make_shared<const ViewResource>(ViewResource{"text/plain", "another"});
  EXPECT_TRUE(Get(kRoot + "wall.ply").ends_with("another"));
  EXPECT_EQ(StatusOf(Ask(server_->port(), "/wall.ply", Host(server_->port()))), 403) << "without the token";
}

TEST_F(ViewServerTest, WhatAViewerAsksForIsDoneAndAnswered) {
  const std::string done = Post(kRoot + "do?request=mark%201%202.5%20polyp%207");
  EXPECT_EQ(StatusOf(done), 200);
  EXPECT_TRUE(done.ends_with("done\n"));
  EXPECT_EQ(asked_, "mark 1 2.5 polyp 7");
  const std::string refused = Post(kRoot + "do?request=no");
  EXPECT_EQ(StatusOf(refused), 409);
  EXPECT_TRUE(refused.ends_with("not now"));
}

TEST_F(ViewServerTest, NothingIsDoneForOthersOrByLooking) {
  const std::string target = kRoot + "do?request=mark";
  EXPECT_EQ(StatusOf(Get(target)), 404);
  EXPECT_EQ(StatusOf(Ask(server_->port(), target, Host(server_->port()) + "Content-Length: 0\r\n", "POST")), 403)
      << "without an origin";
  EXPECT_EQ(StatusOf(Post("/do?request=mark")), 403) << "without the token";
  EXPECT_EQ(StatusOf(Post(target, "Sec-Fetch-Site: cross-site\r\n")), 403);
  EXPECT_EQ(StatusOf(Post(kRoot + "run.json")), 404);
  EXPECT_EQ(asked_, "");
  Result<std::unique_ptr<ViewServer>> looking = ViewServer::Start({}, {0, kServerToken});
  ASSERT_TRUE(looking.ok());
  const int port = (*looking)->port();
  const std::string origin = "Origin: http://127.0.0.1:" + std::to_string(port) + "\r\nContent-Length: 0\r\n";
  EXPECT_EQ(StatusOf(Ask(port, target, Host(port) + origin, "POST")), 404) << "where nothing can be changed";
}

TEST_F(ViewServerTest, EveryAnswerForbidsWhatThePageDoesNotNeed) {
  for (const std::string& answer : {Get(kRoot), Get("/"), Get(kRoot + "other")}) {
    EXPECT_THAT(answer, HasSubstr("Content-Security-Policy: default-src 'none'; script-src 'self';"));
    EXPECT_THAT(answer, HasSubstr("frame-ancestors 'none'"));
    EXPECT_THAT(answer, HasSubstr("Cache-Control: no-store"));
    EXPECT_THAT(answer, HasSubstr("Referrer-Policy: no-referrer"));
    EXPECT_THAT(answer, HasSubstr("X-Content-Type-Options: nosniff"));
    EXPECT_THAT(answer, Not(HasSubstr("Access-Control-Allow")));
  }
}

TEST_F(ViewServerTest, RefusesOthersWithoutSayingTheToken) {
  const int port = server_->port();
  const std::string host = Host(port);
  const std::string refused[] = {
      Ask(port, "/", host),
      Ask(port, "/run.json", host),
      Ask(port, "/0123456789abcdef0123456789abcdee/", host),
      Ask(port, kRoot, "Host: evil.example:" + std::to_string(port) + "\r\n"),
      Ask(port, kRoot, "Host: evil.example\r\n" + host),
      Ask(port, kRoot, ""),
      Ask(port, kRoot, host + "Origin: http://evil.example\r\n"),
      Ask(port, kRoot, host + "Origin: null\r\n"),
      Ask(port, kRoot, host + "Sec-Fetch-Site: cross-site\r\n"),
      Ask(port, kRoot, host + "Content-Length: 0\r\n", "POST"),
      Ask(port, kRoot, host, "OPTIONS"),
      Ask(port, kRoot + "live", host + "Origin: http://evil.example\r\n"),
  };
  for (const std::string& answer : refused) {
    EXPECT_EQ(StatusOf(answer), 403) << answer;
    EXPECT_THAT(answer, Not(HasSubstr(kServerToken)));
    EXPECT_THAT(answer, Not(HasSubstr("page")));
  }
}

// What follows the head of a request is its body. A request in it would have the headers of its choice.
TEST_F(ViewServerTest, NoRequestIsReadFromTheBodyOfAnother) {
  const std::string host = Host(server_->port());
  const std::string origin = "Origin: http://127.0.0.1:" + std::to_string(server_->port()) + "\r\n";
  const std::string hidden =
      "POST " + kRoot + "do?request=mark HTTP/1.1\r\n" + host + origin + "Content-Length: 0\r\n\r\n";
  for (const std::string& head :
       {"POST " + kRoot + "do HTTP/1.1\r\n" + host + "Origin: http://evil.example\r\n",
        "POST " + kRoot + "do?request=no HTTP/1.1\r\n" + host + origin, "GET " + kRoot + "empty HTTP/1.1\r\n" + host}) {
    Connection connection(server_->port());
    connection.Send(head + "Content-Length: " + std::to_string(hidden.size()) + "\r\n\r\n");
    connection.ReadUntil("\r\n\r\n");
    connection.Send(hidden);
    connection.ReadAll();
    EXPECT_NE(asked_, "mark") << head;
    asked_.clear();
  }
}

TEST_F(ViewServerTest, NoFileIsReadByAName) {
  for (const char* name : {"../../../../etc/passwd", "..%2f..%2f..%2fetc%2fpasswd", "%2e%2e/%2e%2e/etc/passwd",
                           "run.json/../../../etc/passwd", "/etc/passwd", "..\\..\\etc\\passwd", "run.json%00.html"}) {
    const std::string answer = Get(kRoot + name);
    EXPECT_THAT(StatusOf(answer), ::testing::AnyOf(400, 403, 404)) << name;
    EXPECT_THAT(answer, Not(HasSubstr("root:"))) << name;
  }
}

TEST_F(ViewServerTest, WhatIsNoRequestDoesNotEndIt) {
  for (const std::string& text :
       {std::string("nonsense\r\n\r\n"), std::string("GET\r\n\r\n"), std::string(20000, 'a') + "\r\n\r\n",
        std::string("GET / HTTP/1.1\r\n") + std::string(20000, 'b') + "\r\n\r\n"}) {
    Connection connection(server_->port());
    connection.Send(text);
    EXPECT_NE(StatusOf(connection.ReadUntil("\r\n\r\n")), 200);
  }
  EXPECT_EQ(StatusOf(Get(kRoot)), 200);
}

TEST_F(ViewServerTest, ListensOnTheLoopbackAddressOnly) {
  // All of 127/8 is this machine, and a socket of every address would take it.
  EXPECT_FALSE(Connection(server_->port(), "127.0.0.2").is_open());
}

TEST_F(ViewServerTest, APortThatIsTakenIsSaid) {
  const Result<std::unique_ptr<ViewServer>> second = ViewServer::Start({}, {server_->port(), kServerToken});
  ASSERT_EQ(second.code(), StatusCode::kUnavailable);
  EXPECT_THAT(second.status().message(),
              HasSubstr("port " + std::to_string(server_->port()) + " of 127.0.0.1 is taken"));
}

TEST_F(ViewServerTest, ViewersHaveStreamsOfTheirOwn) {
  const std::string request = "GET " + kRoot + "live HTTP/1.1\r\n" + Host(server_->port()) + "\r\n";
  Connection first(server_->port());
  first.Send(request);
  EXPECT_THAT(first.ReadUntil("data: 3\n"), HasSubstr("Content-Type: text/event-stream"));
  {
    Connection second(server_->port());
    second.Send(request);
    EXPECT_THAT(second.ReadUntil("data: 2\n"), HasSubstr("data: 1\n"));
    WaitForStreams(2);
  }
  // One that has gone gives its place back, and the other goes on.
  WaitForStreams(1);
  EXPECT_THAT(first.ReadUntil("data: 10\n"), HasSubstr("data: 10\n"));
}

TEST_F(ViewServerTest, MoreViewersThanItHasPlacesForAreToldSo) {
  const std::string request = "GET " + kRoot + "live HTTP/1.1\r\n" + Host(server_->port()) + "\r\n";
  std::vector<std::unique_ptr<Connection>> viewers;
  for (int i = 0; i < kMaxViewers; ++i) {
    viewers.push_back(std::make_unique<Connection>(server_->port()));
    viewers.back()->Send(request);
    EXPECT_EQ(StatusOf(viewers.back()->ReadUntil("data: 1\n")), 200);
  }
  Connection late(server_->port());
  late.Send(request);
  EXPECT_EQ(StatusOf(late.ReadUntil("\r\n\r\n")), 503);
  EXPECT_EQ(StatusOf(Get(kRoot)), 200);
  viewers.clear();
  WaitForStreams(0);
}

TEST_F(ViewServerTest, EndsWithViewersThatStay) {
  Connection viewer(server_->port());
  viewer.Send("GET " + kRoot + "live HTTP/1.1\r\n" + Host(server_->port()) + "\r\n");
  viewer.ReadUntil("data: 1\n");
  const auto begin = std::chrono::steady_clock::now();
  server_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  EXPECT_EQ(num_open_, 0);
}

}  // namespace
}  // namespace haustra::view
