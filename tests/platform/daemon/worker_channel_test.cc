#include "platform/daemon/worker_channel.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "platform/daemon/log.h"

namespace haustra {
namespace {

template <typename Message>
std::vector<std::uint8_t> BytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(sizeof message);
  std::memcpy(bytes.data(), &message, sizeof message);
  return bytes;
}

class WorkerChannel : public testing::Test {
 protected:
  WorkerChannel() { pair_ = *MakeChannel(); }
  ~WorkerChannel() override {
    close(pair_.supervisor);
    if (pair_.worker >= 0) close(pair_.worker);
  }
  ChannelPair pair_;
};

TEST_F(WorkerChannel, RequestsArriveWithTheirFiles) {
  EXPECT_EQ(ReceiveRequest(pair_.worker).code(), StatusCode::kNotFound);
  const int file = memfd_create("file", MFD_CLOEXEC);
  ASSERT_EQ(write(file, "abc", 3), 3);
  ASSERT_TRUE(SendRequest(pair_.supervisor, {.command = WorkerCommand::kSave, .number = 7}, {{file}}).ok());
  ASSERT_TRUE(SendRequest(pair_.supervisor, {.command = WorkerCommand::kStop}, {}).ok());
  close(file);
  const Result<ReceivedRequest> save = ReceiveRequest(pair_.worker);
  ASSERT_TRUE(save.ok()) << save.status().ToString();
  EXPECT_EQ(save->request.command, WorkerCommand::kSave);
  EXPECT_EQ(save->request.number, 7u);
  ASSERT_EQ(save->files.size(), 1u);
  char text[3] = "";
  EXPECT_EQ(pread(save->files[0], text, 3, 0), 3);
  EXPECT_EQ(std::string(text, 3), "abc");
  close(save->files[0]);
  EXPECT_EQ(ReceiveRequest(pair_.worker)->request.command, WorkerCommand::kStop);
}

TEST_F(WorkerChannel, ReportsArriveAsTheyWereSent) {
  WorkerReport report = MakeReport(WorkerNews::kSaved, Unavailable("no room"));
  report.number = 3;
  report.counts.frames = {1, 2, 3};
  report.silence_ns = {1, 2, 3, 4};
  ASSERT_TRUE(SendReport(pair_.worker, report).ok());
  const Result<WorkerReport> received = ReceiveReport(pair_.supervisor);
  ASSERT_TRUE(received.ok()) << received.status().ToString();
  EXPECT_EQ(received->status().ToString(), Unavailable("no room").ToString());
  EXPECT_EQ(received->number, 3u);
  EXPECT_EQ(received->counts.frames, report.counts.frames);
  EXPECT_EQ(received->silence_ns, report.silence_ns);
}

TEST_F(WorkerChannel, MarksAreAskedForAndAnswered) {
  WorkerRequest request{.command = WorkerCommand::kMark, .number = 5};
  request.frame_index = 77;
  request.pixel = {12.5, 3.0};
  std::strcpy(request.label.data(), "polyp");
  ASSERT_TRUE(SendRequest(pair_.supervisor, request, {}).ok());
  const Result<ReceivedRequest> received = ReceiveRequest(pair_.worker);
  ASSERT_TRUE(received.ok()) << received.status().ToString();
  EXPECT_EQ(received->request.frame_index, 77u);
  EXPECT_EQ(received->request.pixel, request.pixel);
  EXPECT_STREQ(received->request.label.data(), "polyp");
  request.label.fill('x');
  ASSERT_TRUE(SendRequest(pair_.supervisor, request, {}).ok());
  EXPECT_EQ(ReceiveRequest(pair_.worker).code(), StatusCode::kDataLoss);

  WorkerReport report = MakeReport(WorkerNews::kMarked, Status(StatusCode::kOk, "marked polyp\n"));
  report.number = 5;
  ASSERT_TRUE(SendReport(pair_.worker, report).ok());
  EXPECT_STREQ(ReceiveReport(pair_.supervisor)->text.data(), "marked polyp\n");
}

TEST_F(WorkerChannel, EndOfTheOtherSideIsHeard) {
  ASSERT_TRUE(SendReport(pair_.worker, MakeReport(WorkerNews::kReady)).ok());
  close(pair_.worker);
  pair_.worker = -1;
  EXPECT_TRUE(ReceiveReport(pair_.supervisor).ok()) << "its last words are";
  EXPECT_EQ(ReceiveReport(pair_.supervisor).code(), StatusCode::kUnavailable);
  EXPECT_EQ(SendRequest(pair_.supervisor, {}, {}).code(), StatusCode::kUnavailable);
}

TEST_F(WorkerChannel, WhoDoesNotReadDoesNotHoldUpTheOther) {
  Status status;
  for (int i = 0; i < 100000 && status.ok(); ++i) status = SendReport(pair_.worker, {});
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
}

TEST_F(WorkerChannel, WorkerPassesNoFilesUp) {
  const WorkerReport report = MakeReport(WorkerNews::kReady);
  iovec part{const_cast<WorkerReport*>(&report), sizeof report};
  alignas(cmsghdr) char control[CMSG_SPACE(sizeof(int))] = {};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control;
  message.msg_controllen = sizeof control;
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof(int));
  const int file = STDIN_FILENO;
  std::memcpy(CMSG_DATA(header), &file, sizeof file);
  ASSERT_EQ(sendmsg(pair_.worker, &message, 0), static_cast<ssize_t>(sizeof report));
  const int next = dup(STDIN_FILENO);
  close(next);
  EXPECT_TRUE(ReceiveReport(pair_.supervisor).ok());
  const int after = dup(STDIN_FILENO);
  close(after);
  EXPECT_EQ(after, next) << "no descriptor more than before";
}

TEST(WorkerReport, WhatNoWorkerSaysIsRefused) {
  RecordProperty("req", "CTL-001");
  const auto is_refused = [](auto change) {
    WorkerReport report;
    change(report);
    return ParseWorkerReport(BytesOf(report)).code() == StatusCode::kDataLoss;
  };
  EXPECT_FALSE(is_refused([](WorkerReport&) {}));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.news = static_cast<WorkerNews>(kNumWorkerNews); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.code = 10; }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.fault = static_cast<WorkerFault>(kNumWorkerFaults); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.signal = kNumSignals; }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.resident_bytes = ~0ull; }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.silence_ns[2] = -1; }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.counts.latency_sum_s = std::numeric_limits<double>::quiet_NaN(); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.counts.last_state = static_cast<TrackingState>(9); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.counts.last_reason = static_cast<TrackingReason>(200); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.text.fill('x'); }));
  EXPECT_TRUE(is_refused([](WorkerReport& r) { r.news = WorkerNews::kFails; })) << "without a reason";
  std::vector<std::uint8_t> bytes = BytesOf(WorkerReport{});
  bytes.pop_back();
  EXPECT_EQ(ParseWorkerReport(bytes).code(), StatusCode::kDataLoss);
  bytes.resize(sizeof(WorkerReport) + 1);
  EXPECT_EQ(ParseWorkerReport(bytes).code(), StatusCode::kDataLoss);
  EXPECT_EQ(ParseWorkerReport({}).code(), StatusCode::kDataLoss);
}

TEST(WorkerReport, TextIsCutAndMadePrintable) {
  const Result<WorkerReport> report =
      ParseWorkerReport(BytesOf(MakeReport(WorkerNews::kFails, Internal("a\x1b[2J\n" + std::string(5000, 'b')))));
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->status().message().size(), kWorkerTextBytes - 1);
  EXPECT_TRUE(report->status().message().starts_with("a?[2J\nb"));
}

TEST(WorkerReport, AnyBytesAreTakenOrRefused) {
  RecordProperty("req", "CTL-001");
  std::mt19937 random(1);
  std::vector<std::uint8_t> bytes = BytesOf(WorkerReport{});
  int num_taken = 0;
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::uint8_t> changed = bytes;
    for (int k = 0; k < 1 + i % 4; ++k) changed[random() % changed.size()] = static_cast<std::uint8_t>(random());
    const Result<WorkerReport> report = ParseWorkerReport(changed);
    if (!report.ok()) continue;
    ++num_taken;
    EXPECT_LT(std::strlen(report->text.data()), kWorkerTextBytes);
  }
  EXPECT_GT(num_taken, 0);
}

TEST(WorkerRequest, WhatNoSupervisorSaysIsRefused) {
  WorkerRequest request;
  request.command = static_cast<WorkerCommand>(kNumWorkerCommands);
  EXPECT_EQ(ParseWorkerRequest(BytesOf(request)).code(), StatusCode::kDataLoss);
  request = {};
  request.label.fill('a');  // no end
  EXPECT_EQ(ParseWorkerRequest(BytesOf(request)).code(), StatusCode::kDataLoss);
  request = {};
  request.pixel[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(ParseWorkerRequest(BytesOf(request)).code(), StatusCode::kDataLoss);
  request = {};
  request.log_level = static_cast<std::uint32_t>(LogLevel::kDebug) + 1;
  EXPECT_EQ(ParseWorkerRequest(BytesOf(request)).code(), StatusCode::kDataLoss);
  request = {};
  request.work_limit_ns = -1;
  EXPECT_EQ(ParseWorkerRequest(BytesOf(request)).code(), StatusCode::kDataLoss);
  EXPECT_EQ(ParseWorkerRequest({}).code(), StatusCode::kDataLoss);
}

}  // namespace
}  // namespace haustra
