#include "platform/daemon/worker_channel.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "engine/atlas/handles.h"
#include "hal/core/errno_text.h"
#include "platform/daemon/log.h"

namespace haustra {
namespace {

static_assert(std::is_trivially_copyable_v<WorkerRequest> && std::is_trivially_copyable_v<WorkerReport>);

// More memory than any machine has: a report that says more is damaged.
constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 50;

Status Nonsense(const char* what) { return DataLoss(std::string("a message of the worker: ") + what); }

Status SendBytes(int channel, const void* bytes, std::size_t num_bytes, std::span<const int> files) {
  iovec part{const_cast<void*>(bytes), num_bytes};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kMaxWorkerFiles * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  if (!files.empty()) {
    HAUSTRA_CHECK(files.size() <= kMaxWorkerFiles);
    message.msg_control = control.data();
    message.msg_controllen = CMSG_SPACE(files.size_bytes());
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(files.size_bytes());
    std::memcpy(CMSG_DATA(header), files.data(), files.size_bytes());
  }
  ssize_t sent = -1;
  do {
    sent = ::sendmsg(channel, &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  } while (sent < 0 && errno == EINTR);
  if (sent == static_cast<ssize_t>(num_bytes)) return Status::Ok();
  return Unavailable("the channel to the worker: " + ErrnoText(errno));
}

// Bytes of one message, at most `bytes.size()`, and its length, which may be more.
Result<std::size_t> ReceiveBytes(int channel, std::span<std::uint8_t> bytes, std::vector<int>* files) {
  iovec part{bytes.data(), bytes.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kMaxWorkerFiles * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  if (files != nullptr) {
    message.msg_control = control.data();
    message.msg_controllen = control.size();
  }
  const ssize_t count = ::recvmsg(channel, &message, MSG_DONTWAIT | MSG_TRUNC | MSG_CMSG_CLOEXEC);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return Status(StatusCode::kNotFound);
  if (count < 0) return Unavailable("the channel: " + ErrnoText(errno));
  if (files != nullptr) {
    for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr; header = CMSG_NXTHDR(&message, header)) {
      if (header->cmsg_level != SOL_SOCKET || header->cmsg_type != SCM_RIGHTS) continue;
      files->resize((header->cmsg_len - CMSG_LEN(0)) / sizeof(int));
      std::memcpy(files->data(), CMSG_DATA(header), files->size() * sizeof(int));
    }
  }
  // Nobody sends an empty message.
  if (count == 0) return Unavailable("the channel: the other end has gone");
  return static_cast<std::size_t>(count);
}

void CloseAll(const std::vector<int>& files) {
  for (const int file : files) ::close(file);
}

template <typename Message>
Status CheckSize(std::span<const std::uint8_t> bytes) {
  return bytes.size() == sizeof(Message) ? Status::Ok() : Nonsense("it has another size");
}

Status CheckCounts(const ProcedureCounts& counts) {
  if (!std::isfinite(counts.latency_sum_s) || counts.latency_sum_s < 0.0) return Nonsense("its latencies");
  if (counts.has_frame > 1) return Nonsense("its last frame");
  if (static_cast<std::uint32_t>(counts.last_state) >= kNumStates) return Nonsense("its tracking state");
  if (static_cast<std::uint32_t>(counts.last_reason) >= kNumReasons) return Nonsense("its reason");
  if (counts.checkpoint_pause.count() < 0) return Nonsense("its pause");
  return Status::Ok();
}

}  // namespace

WorkerReport MakeReport(WorkerNews news, const Status& status) {
  WorkerReport report;
  report.news = news;
  report.code = static_cast<std::uint32_t>(status.code());
  report.SetText(status.message());
  return report;
}

void WorkerReport::SetText(std::string_view message) {
  const std::size_t length = std::min(message.size(), kWorkerTextBytes - 1);
  std::memcpy(text.data(), message.data(), length);
  text[length] = '\0';
}

Result<WorkerReport> ParseWorkerReport(std::span<const std::uint8_t> bytes) {
  HAUSTRA_TRY(CheckSize<WorkerReport>(bytes));
  WorkerReport report;
  std::memcpy(&report, bytes.data(), sizeof report);
  if (static_cast<std::uint32_t>(report.news) >= kNumWorkerNews) return Nonsense("its kind");
  if (report.code > static_cast<std::uint32_t>(StatusCode::kInternal)) return Nonsense("its code");
  if (static_cast<std::uint32_t>(report.fault) >= kNumWorkerFaults) return Nonsense("its fault");
  if (report.signal >= kNumSignals) return Nonsense("its signal");
  if (report.resident_bytes > kMostBytes) return Nonsense("its memory");
  for (const std::int64_t silence_ns : report.silence_ns) {
    if (silence_ns < 0) return Nonsense("a sign of life from the future");
  }
  HAUSTRA_TRY(CheckCounts(report.counts));
  const auto end = std::find(report.text.begin(), report.text.end(), '\0');
  if (end == report.text.end()) return Nonsense("its text does not end");
  // It goes to logs and terminals.
  std::replace_if(
      report.text.begin(), end, [](char c) { return c != '\n' && (static_cast<unsigned char>(c) < 0x20 || c == 0x7f); },
      '?');
  if (report.news == WorkerNews::kFails && report.code == 0) return Nonsense("it fails without a reason");
  return report;
}

Result<WorkerRequest> ParseWorkerRequest(std::span<const std::uint8_t> bytes) {
  HAUSTRA_TRY(CheckSize<WorkerRequest>(bytes));
  WorkerRequest request;
  std::memcpy(&request, bytes.data(), sizeof request);
  if (static_cast<std::uint32_t>(request.command) >= kNumWorkerCommands) return Nonsense("its command");
  if (request.label.back() != '\0') return Nonsense("its label does not end");
  if (!std::isfinite(request.pixel[0]) || !std::isfinite(request.pixel[1])) return Nonsense("its pixel");
  if (request.log_level > static_cast<std::uint32_t>(LogLevel::kDebug)) return Nonsense("its log level");
  if (request.snapshot_interval_ns < 0) return Nonsense("its interval");
  if (request.work_limit_ns < 0) return Nonsense("its limit");
  return request;
}

Result<ChannelPair> MakeChannel() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    return Unavailable("no channel to a worker: " + ErrnoText(errno));
  }
  return ChannelPair{ends[0], ends[1]};
}

Status SendRequest(int channel, const WorkerRequest& request, std::span<const int> files) {
  return SendBytes(channel, &request, sizeof request, files);
}

Status SendReport(int channel, const WorkerReport& report) { return SendBytes(channel, &report, sizeof report, {}); }

Result<WorkerReport> ReceiveReport(int channel) {
  std::array<std::uint8_t, sizeof(WorkerReport)> bytes;
  HAUSTRA_ASSIGN(const std::size_t length, ReceiveBytes(channel, bytes, nullptr));
  if (length > bytes.size()) return Nonsense("it has another size");
  return ParseWorkerReport({bytes.data(), length});
}

Result<ReceivedRequest> ReceiveRequest(int channel) {
  std::array<std::uint8_t, sizeof(WorkerRequest)> bytes;
  ReceivedRequest received;
  const Result<std::size_t> length = ReceiveBytes(channel, bytes, &received.files);
  const Result<WorkerRequest> request =
      length.ok() ? ParseWorkerRequest({bytes.data(), std::min(*length, bytes.size())}) : length.status();
  if (!request.ok() || *length > bytes.size()) {
    CloseAll(received.files);
    return request.ok() ? Nonsense("it has another size") : request.status();
  }
  received.request = *request;
  return received;
}

}  // namespace haustra
