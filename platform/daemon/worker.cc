#include "platform/daemon/worker.h"

#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hal/core/seconds_text.h"
#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/daemon/descriptor_sink.h"
#include "platform/daemon/file_worker.h"
#include "platform/daemon/log.h"
#include "platform/daemon/no_dumps.h"
#include "platform/daemon/open_source.h"
#include "platform/daemon/status_text.h"
#include "platform/daemon/worker_channel.h"
#include "platform/exit_codes.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/view_ring_writer.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kAliveInterval = milliseconds(50);
constexpr Duration kSourceRetry = seconds(1);
constexpr Duration kJumpLogInterval = seconds(60);

class Worker {
 public:
  Worker(int channel, const WorkerParts& parts)
      : channel_(channel), parts_(parts), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

  int Run() {
    if (wake_ < 0) return kExitSystem;
    for (TimePoint next_alive = clock_.Now();;) {
      std::array<pollfd, 2> events{{{channel_, POLLIN, 0}, {wake_, POLLIN, 0}}};
      const auto wait = std::clamp(next_alive - clock_.Now(), Duration(0), Duration(kAliveInterval));
      ::poll(events.data(), events.size(), static_cast<int>(wait / milliseconds(1)) + 1);
      std::uint64_t count = 0;
      [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
      while (true) {
        Result<ReceivedRequest> received = ReceiveRequest(channel_);
        if (received.code() == StatusCode::kNotFound) break;
        if (!received.ok()) return kExitOk;
        Handle(received->request, std::move(received->files));
      }
      LookAtSession();
      LookAtTimes();
      SendNews();
      if (clock_.Now() < next_alive) continue;
      // When it cannot be sent the next one does as well.
      (void)SendReport(channel_, Filled(MakeReport(WorkerNews::kAlive)));
      next_alive = clock_.Now() + kAliveInterval;
    }
  }

 private:
  void Handle(const WorkerRequest& request, std::vector<int> files) {
    switch (request.command) {
      case WorkerCommand::kPrepare: jobs_.Do([this, files = std::move(files)] { Prepare(files); }); return;
      case WorkerCommand::kSettings:
        SetLogLevel(static_cast<LogLevel>(request.log_level));
        settings_.snapshot_interval = Duration(request.snapshot_interval_ns);
        settings_.work_limit = Duration(request.work_limit_ns);
        return;
      case WorkerCommand::kLoad: jobs_.Do([this, files = std::move(files)] { Load(files); }); return;
      case WorkerCommand::kBegin:
        jobs_.Do([this, number = request.number] {
          procedure_.load()->Start(number);
          is_running_.store(true);
          Post(MakeReport(WorkerNews::kBegun));
        });
        return;
      case WorkerCommand::kStop:
        if (Procedure* procedure = procedure_.load()) procedure->RequestStop();
        is_running_.store(false);
        jobs_.Do([this] {
          procedure_.load()->Stop();
          Post(Filled(MakeReport(WorkerNews::kStopped)));
        });
        return;
      case WorkerCommand::kSave:
        jobs_.Do([this, number = request.number, files = std::move(files)] { Save(number, files); });
        return;
      case WorkerCommand::kMark:
      case WorkerCommand::kUnmark:
      case WorkerCommand::kListMarks: jobs_.Do([this, request] { AskOfMarks(request); }); return;
    }
  }

  // What it makes is never thrown away: the process is.
  void Prepare(const std::vector<int>& files) {
    const Result<std::string> device = MakeProcedure(files);
    for (const int file : files) ::close(file);
    Post(device.ok() ? MakeReport(WorkerNews::kReady, Status(StatusCode::kOk, *device))
                     : MakeReport(WorkerNews::kFails, device.status()));
  }

  // The name of its vision device.
  Result<std::string> MakeProcedure(const std::vector<int>& files) {
    if (files.size() < 2) return Internal("the worker needs a configuration and a pose ring");
    HAUSTRA_ASSIGN(const std::string text, ReadWholeFile(files[0]));
    ConfigStore<DaemonConfig> store(DaemonConfigFields());
    HAUSTRA_TRY(store.ApplyText(text, "configuration of the service"));
    DaemonConfig config = store.config();
    config.vision.device = std::string(ResolveVisionDevice(config.vision.device));
    SetLogLevel(LogLevelFrom(config.log.level));
    HAUSTRA_ASSIGN(ring_, PoseRingWriter::Attach(files[1]));
    const PublishConfig& publish = config.publish;
    if (files.size() != std::size_t{2} + (publish.view ? 1 : 0) + (publish.depth ? 1 : 0)) {
      return Internal("the worker needs a file for everything that it is to publish");
    }
    if (publish.view) {
      HAUSTRA_ASSIGN(view_, ViewRingWriter::Attach(files[2]));
    }
    if (publish.depth) {
      HAUSTRA_ASSIGN(depth_, DepthTableWriter::Attach(files.back()));
    }
    std::unique_ptr<FrameSource> source;
    while (source == nullptr) {
      Result<std::unique_ptr<FrameSource>> opened = parts_.open_source(config.source);
      if (opened.ok()) {
        source = std::move(*opened);
        break;
      }
      if (!IsCamera(config.source) || opened.code() != StatusCode::kUnavailable) return opened.status();
      Post(MakeReport(WorkerNews::kWaits, opened.status()));
      std::this_thread::sleep_for(kSourceRetry);
    }
    Result<std::unique_ptr<Procedure>> made = Procedure::Prepare(
        config, std::move(source),
        {clock_, settings_, *ring_, view_.get(), depth_.get(), parts_.make_device, [this] { Wake(); }});
    HAUSTRA_TRY(made.status());
    procedure_.store(made->release());
    return config.vision.device;
  }

  void Load(const std::vector<int>& files) {
    Status status = Internal("no checkpoint was given");
    if (!files.empty()) {
      const Result<std::string> bytes = ReadWholeFile(files[0]);
      status = bytes.ok()
                   ? procedure_.load()->Load({reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()})
                   : bytes.status();
    }
    for (const int file : files) ::close(file);
    Post(MakeReport(WorkerNews::kLoaded, status));
  }

  void Save(std::uint64_t number, const std::vector<int>& files) {
    const auto saved = [this, number](const Status& status) {
      WorkerReport report = MakeReport(WorkerNews::kSaved, status);
      report.number = number;
      report.num_changes = procedure_.load()->num_changes();
      Post(report);
    };
    if (files.size() != 1) {
      for (const int file : files) ::close(file);
      return saved(Internal("no file was given"));
    }
    procedure_.load()->Save(std::make_unique<DescriptorSink>(files[0]), saved);
  }

  void AskOfMarks(const WorkerRequest& request) {
    MarkOrder order;
    order.kind = request.command == WorkerCommand::kMark     ? MarkOrder::Kind::kSet
                 : request.command == WorkerCommand::kUnmark ? MarkOrder::Kind::kRemove
                                                             : MarkOrder::Kind::kList;
    order.request.frame_index = request.frame_index;
    order.request.pixel = {request.pixel[0], request.pixel[1]};
    order.request.label = MarkLabel::From(request.label.data()).value_or(MarkLabel());
    order.done = [this, number = request.number](const Result<std::string>& answer) {
      WorkerReport report =
          MakeReport(WorkerNews::kMarked, answer.ok() ? Status(StatusCode::kOk, *answer) : answer.status());
      report.number = number;
      Post(report);
    };
    procedure_.load()->Order(std::move(order));
  }

  void LookAtSession() {
    if (!is_running_.load() || has_said_end_) return;
    const std::optional<Status> ended = procedure_.load()->ended();
    if (!ended) return;
    has_said_end_ = true;
    Post(Filled(MakeReport(WorkerNews::kSessionEnds, *ended)));
  }

  // A camera whose clock is another one says so with every frame.
  void LookAtTimes() {
    const TimePoint now = clock_.Now();
    if (!is_running_.load() || now < next_jump_log_) return;
    const std::optional<TimeJump> jump = procedure_.load()->TakeTimeJump();
    if (!jump) return;
    next_jump_log_ = now + kJumpLogInterval;
    Log(LogLevel::kWarning, "frame_time_jumps",
        {{"before_s", SecondsText(jump->before)},
         {"stated_s", SecondsText(jump->stated)},
         {"what", jump->taken == jump->stated ? "the recording pauses, and so do the frames"
                                              : SecondsText(jump->taken) + " s is taken"},
         {"more", std::to_string(jump->num_more)}});
  }

  // With what is known now.
  WorkerReport Filled(WorkerReport report) const {
    report.resident_bytes = ResidentBytes();
    const Procedure* procedure = procedure_.load();
    if (procedure == nullptr) return report;
    report.fault = static_cast<WorkerFault>(procedure->fault());
    report.signal = static_cast<std::uint32_t>(procedure->signal());
    if (report.news == WorkerNews::kAlive) report.SetText(procedure->signal_text());
    report.num_changes = procedure->num_changes();
    report.counts = procedure->counts();
    const SignsOfLife signs = procedure->signs();
    const TimePoint now = clock_.Now();
    const TimePoint last[] = {signs.tracking, signs.capture, signs.mapping, signs.merging};
    for (std::size_t i = 0; i < report.silence_ns.size(); ++i) {
      report.silence_ns[i] = std::max<std::int64_t>(0, (now - last[i]).count());
    }
    return report;
  }

  // Any thread.
  void Post(const WorkerReport& report) {
    {
      const std::lock_guard lock(mutex_);
      news_.push_back(report);
    }
    Wake();
  }
  void Wake() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake_, &one, sizeof one);
  }
  // A supervisor that does not read now gets them later, in order.
  void SendNews() {
    const std::lock_guard lock(mutex_);
    while (!news_.empty() && SendReport(channel_, news_.front()).ok()) news_.pop_front();
  }

  const int channel_;
  const WorkerParts& parts_;
  const SystemClock clock_;
  const int wake_;
  std::unique_ptr<PoseRingWriter> ring_;
  std::unique_ptr<ViewRingWriter> view_;     // null: publish.view is off
  std::unique_ptr<DepthTableWriter> depth_;  // null: publish.depth is off
  std::atomic<Procedure*> procedure_{nullptr};
  std::atomic<bool> is_running_{false};
  bool has_said_end_ = false;
  TimePoint next_jump_log_;
  LiveSettings settings_;
  std::mutex mutex_;
  std::deque<WorkerReport> news_;
  FileWorker jobs_;
};

}  // namespace

WorkerParts SystemWorkerParts() {
  return {OpenSource, [](const DaemonConfig& config, const CameraCalibration& calibration) {
            return CreateVisionDevice(config.vision.device, config.engine, calibration,
                                      NumVisionThreads(config.vision.threads, config.engine, Engine::Mode::kRealTime));
          }};
}

bool BecomeWorker() {
  ::prctl(PR_SET_NAME, "haustrad-worker", 0, 0, 0);
  // Its parent may be gone by now; then the channel has ended, too.
  return ::prctl(PR_SET_PDEATHSIG, SIGKILL, 0, 0, 0) == 0 && ForbidDumps();
}

int RunWorker(int channel, const WorkerParts& parts) {
  // Never destroyed: threads may still run when the process ends.
  return (new Worker(channel, parts))->Run();
}

}  // namespace haustra
