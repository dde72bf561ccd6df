#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "platform/control/control_client.h"
#include "platform/control/control_server.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, path.c_str());
  return address;
}

std::string Message(std::string_view packet) { return ParseControlRequest(packet).status().message(); }

TEST(ControlProtocol, RequestsAreReadAndWrittenAlike) {
  for (const char* text :
       {"status", "metrics", "begin", "begin room-3.case_7", "resume", "end", "end keep", "end wipe", "save 2026-11-21",
        "mark 1 2 a", "mark 1 2 a 7", "mark 1 2 a 7 3", "unmark a", "unmark a 3"}) {
    const Result<ControlRequest> request = ParseControlRequest(text);
    ASSERT_TRUE(request.ok()) << text << ": " << request.status().ToString();
    EXPECT_EQ(ToText(*request), text);
  }
  const ControlRequest mark = ParseControlRequest("mark 12.5 -3 polyp_1 77").value();
  EXPECT_EQ(mark.x_px, 12.5);
  EXPECT_EQ(mark.y_px, -3.0);
  EXPECT_EQ(mark.name, "polyp_1");
  EXPECT_EQ(mark.frame_index, 77u);
  EXPECT_EQ(mark.procedure, std::nullopt);
  EXPECT_EQ(ParseControlRequest("mark 1 2 a")->frame_index, std::nullopt);
  EXPECT_EQ(ParseControlRequest("mark 1 2 a 7 3")->procedure, 3u);
  EXPECT_EQ(ParseControlRequest("unmark a 18446744073709551615")->procedure, 18446744073709551615u);
  EXPECT_EQ(ParseControlRequest("begin case7\n")->name, "case7");
  EXPECT_EQ(ParseControlRequest("end keep")->keep, true);
  EXPECT_EQ(ParseControlRequest("end")->keep, std::nullopt);
}

TEST(ControlProtocol, WhatIsWrongIsSaid) {
  RecordProperty("req", "CTL-001");
  EXPECT_NE(Message("stop").find("unknown request 'stop'"), std::string::npos);
  EXPECT_NE(Message("").find("unknown request ''"), std::string::npos);
  EXPECT_NE(Message("end maybe").find("'maybe' is neither keep nor wipe"), std::string::npos);
  EXPECT_NE(Message("status now").find("takes no argument"), std::string::npos);
  EXPECT_NE(Message("begin ").find("ends in a space"), std::string::npos);
  EXPECT_EQ(Message("mark"), "mark: X is missing; mark X Y LABEL [FRAME [PROCEDURE]]");
  EXPECT_EQ(Message("mark 1"), "mark: Y is missing; mark X Y LABEL [FRAME [PROCEDURE]]");
  EXPECT_EQ(Message("mark 1 2"), "mark: LABEL is missing; mark X Y LABEL [FRAME [PROCEDURE]]");
  EXPECT_EQ(Message("save"), "save: NAME is missing");
  EXPECT_EQ(Message("unmark"), "unmark: LABEL is missing");
  EXPECT_NE(Message("mark 1 nan a").find("'nan' is no pixel"), std::string::npos);
  EXPECT_NE(Message("mark 1 1e7 a").find("'1e7' is no pixel"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 " + std::string(32, 'a')).find("is not a label"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 a b").find("'b' is no frame number"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 a -1").find("'-1' is no frame number"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 a 7 b").find("'b' is no number of a procedure"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 a 7 3 4").find("'3 4' is no number of a procedure"), std::string::npos);
  EXPECT_NE(Message("unmark a -1").find("'-1' is no number of a procedure"), std::string::npos);
  EXPECT_NE(Message("mark 1 2 a ").find("ends in a space"), std::string::npos);
  EXPECT_NE(Message("unmark a/b").find("is not a label"), std::string::npos);
  EXPECT_NE(Message("marks all").find("takes no argument"), std::string::npos);
  EXPECT_NE(Message(std::string("begin a\0b", 9)).find("not printable"), std::string::npos);
  EXPECT_NE(Message(std::string(kMaxRequestBytes + 1, 'a')).find("longer than"), std::string::npos);
  // A name never leads out of its folder.
  for (const char* name : {"..", "../a", "/etc/passwd", "a/b", ".hidden", "a b", "-rf"}) {
    EXPECT_FALSE(IsControlName(name)) << name;
    EXPECT_FALSE(ParseControlRequest(std::string("save ") + name).ok()) << name;
  }
  EXPECT_TRUE(IsControlName(std::string(kMaxNameBytes, 'a')));
  EXPECT_FALSE(IsControlName(std::string(kMaxNameBytes + 1, 'a')));
}

TEST(ControlProtocol, RepliesAreReadBack) {
  EXPECT_EQ(*ParseReply(ReplyText(std::string("state idle\n"))), "state idle\n");
  const Result<std::string> refused = ParseReply(ReplyText(FailedPrecondition("no procedure")));
  EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(refused.status().message(), "no procedure");
  EXPECT_EQ(ParseReply("HTTP/1.1 200").code(), StatusCode::kDataLoss);
  EXPECT_EQ(ReplyText(std::string(2 * kMaxReplyBytes, 'x')).size(), kMaxReplyBytes);
}

// A server on a thread of its own; its time is the test's.
class ControlSocket : public testing::Test {
 protected:
  ControlSocket() {
    std::string pattern = testing::TempDir() + "control_XXXXXX";
    folder_ = mkdtemp(pattern.data());
    path_ = folder_ + "/control";
  }
  ~ControlSocket() override {
    Stop();
    fs::remove_all(folder_);
  }

  void Start(const ControlLimits& limits) {
    auto server = ControlServer::Create(path_, 0660, static_cast<gid_t>(-1), limits,
                                        [this](ControlServer::ClientId id, const ControlPeer& peer,
                                               const ControlRequest& request) -> std::optional<Result<std::string>> {
                                          peer_ = peer;
                                          if (request.command == ControlCommand::kSave) {
                                            waiting_ = id;
                                            return std::nullopt;
                                          }
                                          return std::string("did " + ToText(request));
                                        });
    ASSERT_TRUE(server.ok()) << server.status().ToString();
    server_ = std::move(*server);
    thread_ = std::thread([this] {
      while (!stop_) {
        const TimePoint now{Duration(now_ns_)};
        server_->Serve(now);
        num_clients_ = server_->num_clients();
        num_refused_ = server_->num_refused();
        num_malformed_ = server_->num_malformed();
        if (answer_now_.exchange(false)) server_->Reply(waiting_, std::string("saved"), now);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    });
  }
  void Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    server_.reset();
  }
  ControlClient Connect() {
    Result<ControlClient> client = ControlClient::Connect(path_);
    EXPECT_TRUE(client.ok()) << client.status().ToString();
    return std::move(*client);
  }
  void WaitFor(const std::function<bool()>& condition) {
    for (int i = 0; i < 20000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_TRUE(condition());
  }

  std::string folder_, path_;
  std::unique_ptr<ControlServer> server_;
  std::thread thread_;
  std::atomic<bool> stop_{false}, answer_now_{false};
  std::atomic<std::int64_t> now_ns_{0};
  std::atomic<int> num_clients_{0};
  std::atomic<std::uint64_t> num_refused_{0}, num_malformed_{0};
  std::atomic<ControlServer::ClientId> waiting_{0};
  ControlPeer peer_;
};

constexpr Duration kLimit = seconds(60);

TEST_F(ControlSocket, WhoMayOnlyLookChangesNothing) {
  RecordProperty("req", "CTL-003");
  ControlLimits limits;
  limits.only_looks = true;
  Start(limits);
  ControlClient client = Connect();
  EXPECT_EQ(*client.Ask("status", seconds(10)), "did status");
  EXPECT_EQ(*client.Ask("metrics", seconds(10)), "did metrics");
  for (const char* request : {"begin", "begin case-1", "resume", "end", "end keep", "end wipe", "save one"}) {
    const Result<std::string> reply = client.Ask(request, seconds(10));
    EXPECT_EQ(reply.code(), StatusCode::kFailedPrecondition) << request;
    EXPECT_NE(reply.status().message().find("status and metrics only"), std::string::npos) << request;
  }
  EXPECT_EQ(*client.Ask("status", seconds(10)), "did status");
}

TEST_F(ControlSocket, AnswersOneRequestAfterTheOther) {
  Start({});
  ControlClient client = Connect();
  EXPECT_EQ(*client.Ask("status", kLimit), "did status");
  EXPECT_EQ(*client.Ask("begin case-1", kLimit), "did begin case-1");
  EXPECT_EQ(peer_.pid, getpid());
  EXPECT_EQ(peer_.uid, getuid());
  struct stat info {};
  ASSERT_EQ(stat(path_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0660u);
  Stop();
  EXPECT_FALSE(fs::exists(path_));
  EXPECT_EQ(client.Ask("status", kLimit).code(), StatusCode::kUnavailable);
  EXPECT_EQ(ControlClient::Connect(path_).code(), StatusCode::kNotFound);
}

TEST_F(ControlSocket, AnswerMayComeLaterWhileOthersAreServed) {
  Start({});
  ControlClient saver = Connect();
  Result<std::string> saved = Unavailable("not yet");
  std::thread asking([&] { saved = saver.Ask("save a", kLimit); });
  WaitFor([&] { return waiting_ != 0; });
  EXPECT_EQ(*Connect().Ask("status", kLimit), "did status");
  // Longer than the idle limit: who waits for an answer is not idle.
  now_ns_ = Duration(seconds(1000)).count();
  EXPECT_EQ(*Connect().Ask("metrics", kLimit), "did metrics");
  answer_now_ = true;
  asking.join();
  ASSERT_TRUE(saved.ok()) << saved.status().ToString();
  EXPECT_EQ(*saved, "saved");
}

// As when the client is stopped and goes on (Ctrl-Z, fg). What was asked for would be dropped with it.
TEST_F(ControlSocket, ASignalDoesNotEndTheWaitForTheAnswer) {
  Start({});
  struct sigaction heard {};
  struct sigaction before {};
  heard.sa_handler = [](int) {};
  ASSERT_EQ(sigaction(SIGUSR2, &heard, &before), 0);
  ControlClient saver = Connect();
  Result<std::string> saved = Unavailable("not yet");
  std::thread asking([&] { saved = saver.Ask("save a", kLimit); });
  WaitFor([&] { return waiting_ != 0; });
  for (int i = 0; i < 20; ++i) {
    pthread_kill(asking.native_handle(), SIGUSR2);
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  answer_now_ = true;
  asking.join();
  sigaction(SIGUSR2, &before, nullptr);
  ASSERT_TRUE(saved.ok()) << saved.status().ToString();
  EXPECT_EQ(*saved, "saved");
}

TEST_F(ControlSocket, NonsenseIsAnsweredAndTheClientMayGoOn) {
  RecordProperty("req", "CTL-001");
  Start({});
  ControlClient client = Connect();
  EXPECT_EQ(client.Ask(std::string("\x01\xff\n\x80", 4), kLimit).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(client.Ask(std::string(100000, 'x'), kLimit).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(*client.Ask("status", kLimit), "did status");
  EXPECT_EQ(num_malformed_, 2u);
}

TEST_F(ControlSocket, ClientsAboveTheLimitAreRefusedAndTheOthersServed) {
  RecordProperty("req", "CTL-002");
  ControlLimits limits;
  limits.max_clients = 8;
  limits.max_clients_per_user = 3;
  Start(limits);
  std::vector<ControlClient> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(Connect());
    EXPECT_TRUE(clients.back().Ask("status", kLimit).ok());
  }
  ControlClient fourth = Connect();
  const Result<std::string> refused = fourth.Ask("status", kLimit);
  EXPECT_FALSE(refused.ok());
  WaitFor([&] { return num_refused_ == 1; });
  EXPECT_TRUE(clients[0].Ask("status", kLimit).ok());
  clients.pop_back();
  WaitFor([&] { return num_clients_ == 2; });
  EXPECT_TRUE(Connect().Ask("status", kLimit).ok());
}

TEST_F(ControlSocket, IdleClientsAndThoseThatDoNotReadAreDisconnected) {
  RecordProperty("req", "CTL-002");
  Start({});
  ControlClient idle = Connect();
  ASSERT_TRUE(idle.Ask("status", kLimit).ok());
  now_ns_ = Duration(seconds(31)).count();
  WaitFor([&] { return num_clients_ == 0; });
  EXPECT_EQ(idle.Ask("status", kLimit).code(), StatusCode::kUnavailable);

  // Asks and asks, and reads nothing.
  const int deaf = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const sockaddr_un address = AddressOf(path_);
  ASSERT_EQ(connect(deaf, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  WaitFor([&] { return send(deaf, "status", 6, MSG_NOSIGNAL | MSG_DONTWAIT) < 0 && errno == EPIPE; });
  EXPECT_TRUE(Connect().Ask("status", kLimit).ok());
  close(deaf);
}

TEST_F(ControlSocket, StaleSocketOfACrashIsReplaced) {
  RecordProperty("req", "DMN-006");
  {
    const int stale = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    const sockaddr_un address = AddressOf(path_);
    ASSERT_EQ(bind(stale, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    close(stale);
  }
  EXPECT_EQ(ControlClient::Connect(path_).code(), StatusCode::kUnavailable);
  Start({});
  EXPECT_TRUE(Connect().Ask("status", kLimit).ok());
}

// A daemon that hangs: what listens at `path` lets nobody in.
int ListenDeaf(const std::string& path) {
  const int deaf = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  const sockaddr_un address = AddressOf(path);
  EXPECT_EQ(bind(deaf, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(listen(deaf, 0), 0);
  return deaf;
}

TEST_F(ControlSocket, AQueueThatIsFullHoldsNobodyUp) {
  const int deaf = ListenDeaf(path_);
  const sockaddr_un address = AddressOf(path_);
  std::vector<int> waiting;
  int error = 0;
  while (error == 0 && waiting.size() < 100) {
    waiting.push_back(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (connect(waiting.back(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) error = errno;
  }
  ASSERT_EQ(error, EAGAIN);
  const Result<ControlClient> client = ControlClient::Connect(path_);
  EXPECT_EQ(client.code(), StatusCode::kUnavailable);
  EXPECT_EQ(client.status().message(), path_ + ": haustrad takes no connections");
  for (const int each : waiting) close(each);
  close(deaf);
}

TEST_F(ControlSocket, RequestsThatLieUnreadHoldNobodyUp) {
  const int deaf = ListenDeaf(path_);
  ControlClient client = Connect();
  Status status(StatusCode::kDeadlineExceeded);
  for (int i = 0; i < 10000 && status.code() == StatusCode::kDeadlineExceeded; ++i) {
    status = client.Ask("status", Duration(0)).status();
  }
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_EQ(status.message(), "haustrad takes no requests");
  close(deaf);
}

TEST(ControlServer, BadPathsAreErrors) {
  const auto handler = [](auto...) { return Result<std::string>(std::string()); };
  EXPECT_EQ(ControlServer::Create("/nonexistent/control", 0660, static_cast<gid_t>(-1), {}, handler).code(),
            StatusCode::kNotFound);
  EXPECT_EQ(ControlServer::Create(std::string(200, 'a'), 0660, static_cast<gid_t>(-1), {}, handler).code(),
            StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra
