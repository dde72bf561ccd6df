// What haustrad and its worker say to each other: one SOCK_SEQPACKET pair, messages of fixed size, open files beside
// them. Both ends are one program. Still, what comes up from a worker is data of another process, one that reads
// pictures of unknown origin: it is checked like a client's, and a worker that sends something else is done with.
//
//   down   prepare (with the configuration and the pose ring), settings, load (with a checkpoint), begin, stop,
//          save (with a file to write into), mark, unmark, list_marks
//   up     waits, ready, fails, loaded, begun, stopped, saved, session_ends, marked, and 20 times a second alive
//
// A worker that meets the end of the channel ends. So it never outlives the service.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"
#include "hal/core/time.h"
#include "platform/daemon/procedure_counts.h"

namespace haustra {

enum class WorkerCommand : std::uint32_t {
  kPrepare,
  kSettings,
  kLoad,
  kBegin,
  kStop,
  kSave,
  kMark,
  kUnmark,
  kListMarks
};
inline constexpr std::uint32_t kNumWorkerCommands = 9;

struct WorkerRequest {
  WorkerCommand command = WorkerCommand::kStop;
  std::uint32_t log_level = 0;            // kSettings: LogLevel
  std::uint64_t number = 0;               // kBegin: of the procedure; kSave and those of marks: what its answer bears
  std::int64_t snapshot_interval_ns = 0;  // kSettings
  std::int64_t work_limit_ns = 0;         // kSettings
  // kMark; kUnmark: the label.
  std::uint32_t frame_index = 0;
  std::uint32_t reserved = 0;
  std::array<double, 2> pixel{};
  std::array<char, 32> label{};  // ends with a zero
};

enum class WorkerNews : std::uint32_t {
  kAlive,   // signs, counts; text: why there is no signal
  kWaits,   // text: for what
  kReady,   // text: the name of its vision device
  kFails,   // code, text
  kLoaded,  // code, text
  kBegun,
  kStopped,      // fault; the threads have ended
  kSaved,        // number, num_changes, code, text
  kSessionEnds,  // fault, code, text
  kMarked,       // number, code, text: the answer to what was asked of marks
};
inline constexpr std::uint32_t kNumWorkerNews = 10;

enum class WorkerFault : std::uint32_t { kNone, kLost, kHung };
inline constexpr std::uint32_t kNumWorkerFaults = 3;
inline constexpr std::uint32_t kNumSignals = 4;  // SignalState

// A list of all marks that there may be.
inline constexpr std::size_t kWorkerTextBytes = 4096;

struct WorkerReport {
  WorkerNews news = WorkerNews::kAlive;
  std::uint32_t code = 0;  // StatusCode
  WorkerFault fault = WorkerFault::kNone;
  std::uint32_t signal = 0;  // SignalState
  std::uint64_t number = 0;
  std::uint64_t num_changes = 0;  // of the maps since begin; kSaved: those that the file has
  std::uint64_t resident_bytes = 0;
  // How long ago each thread gave a sign of life.
  std::array<std::int64_t, 4> silence_ns{};  // tracking, capture, mapping, merging
  ProcedureCounts counts;
  std::array<char, kWorkerTextBytes> text{};  // ends with a zero

  Status status() const { return Status(static_cast<StatusCode>(code), text.data()); }
  // As much of it as there is room for.
  void SetText(std::string_view message);
};

WorkerReport MakeReport(WorkerNews news, const Status& status = Status::Ok());

// The bytes of one message as they came; kDataLoss says what is wrong with them. Any bytes may come. reentrant.
Result<WorkerReport> ParseWorkerReport(std::span<const std::uint8_t> bytes);
Result<WorkerRequest> ParseWorkerRequest(std::span<const std::uint8_t> bytes);

inline constexpr std::size_t kMaxWorkerFiles = 4;

// The two ends, closed on exec.
struct ChannelPair {
  int supervisor = -1;
  int worker = -1;
};
Result<ChannelPair> MakeChannel();

// None of these waits. kUnavailable: the other end has gone, or does not read.
Status SendRequest(int channel, const WorkerRequest& request, std::span<const int> files);
Status SendReport(int channel, const WorkerReport& report);

// kNotFound: nothing there now. kUnavailable: the other end has gone. kDataLoss: not a message. Files that a worker
// sends are not taken.
Result<WorkerReport> ReceiveReport(int channel);
struct ReceivedRequest {
  WorkerRequest request;
  std::vector<int> files;  // the receiver's to close; closed on exec
};
Result<ReceivedRequest> ReceiveRequest(int channel);

}  // namespace haustra
