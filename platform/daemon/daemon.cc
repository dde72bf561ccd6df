#include "platform/daemon/daemon.h"

#include <grp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <utility>

#include "platform/daemon/log.h"
#include "platform/daemon/open_source.h"
#include "platform/daemon/status_text.h"
#include "platform/daemon/wipe_memory.h"
#include "platform/exit_codes.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr mode_t kSharedMode = 0660;    // control socket: who may use it may begin and end procedures
constexpr mode_t kReadableMode = 0640;  // poses
constexpr Duration kSourceRetry = seconds(1);

std::string FolderFrom(const std::string& configured, const char* variable) {
  if (!configured.empty()) return configured;
  const char* value = std::getenv(variable);
  // systemd gives a list when the unit names several.
  return value == nullptr ? std::string() : std::string(value).substr(0, std::string(value).find(':'));
}

Result<gid_t> GroupOf(const std::string& name) {
  if (name.empty()) return static_cast<gid_t>(-1);
  const group* entry = ::getgrnam(name.c_str());
  if (entry == nullptr) return FailedPrecondition("publish.group: there is no group '" + name + "'");
  return entry->gr_gid;
}

int FailStart(const Status& status, int code) {
  Log(LogLevel::kError, "cannot_start", {{"what", status.message()}});
  return code;
}

std::string Joined(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) all += (all.empty() ? "" : ",") + text;
  return all;
}

haustra_event ProcedureEvent(haustra_event_kind kind, std::uint64_t number) {
  haustra_event event{};
  event.published_ns = haustra_now_ns();
  event.procedure = number;
  event.kind = kind;
  event.map_id = event.other_map_id = HAUSTRA_NO_MAP;
  return event;
}

}  // namespace

Daemon::Daemon(const DaemonConfig& config, ConfigSource config_source, const Clock& clock)
    : config_(config),
      config_source_(std::move(config_source)),
      clock_(clock),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      started_(clock.Now()) {}

Daemon::~Daemon() {
  procedure_.reset();
  files_.Finish();
  if (wake_ >= 0) ::close(wake_);
}

sigset_t Daemon::BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1}) sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

void Daemon::Wake() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_, &one, sizeof one);
}

int Daemon::Run() {
  const sigset_t set = BlockSignals();
  const int signals = ::signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
  if (signals < 0 || wake_ < 0) return FailStart(Unavailable("the system gives no descriptors"), kExitSystem);
  const int code = SetUp();
  const int result = code == kExitOk ? Loop(signals) : code;
  ::close(signals);
  return result;
}

int Daemon::SetUp() {
  SetLogLevel(LogLevelFrom(config_.log.level));
  const std::string state_folder = FolderFrom(config_.files.state_folder, "STATE_DIRECTORY");
  const std::string runtime_folder = FolderFrom(config_.files.runtime_folder, "RUNTIME_DIRECTORY");
  if (state_folder.empty() || runtime_folder.empty()) {
    return FailStart(FailedPrecondition("files.state_folder and files.runtime_folder must be set (systemd does it by "
                                        "StateDirectory= and RuntimeDirectory=)"),
                     kExitConfig);
  }
  if (config_.source.path.empty()) return FailStart(FailedPrecondition("source.path is not set"), kExitConfig);
  const Result<gid_t> group = GroupOf(config_.publish.group);
  if (!group.ok()) return FailStart(group.status(), kExitConfig);

  Result<std::unique_ptr<ProcedureStore>> store = ProcedureStore::Open(state_folder);
  if (!store.ok()) {
    return FailStart(store.status(), store.code() == StatusCode::kFailedPrecondition ? kExitBusy : kExitIo);
  }
  store_ = std::move(*store);
  Result<std::unique_ptr<PoseRingWriter>> ring =
      PoseRingWriter::Create(runtime_folder + "/poses", kReadableMode, *group);
  if (!ring.ok()) return FailStart(ring.status(), kExitIo);
  ring_ = std::move(*ring);

  if (const Status status = PrepareProcedure(); !status.ok()) return FailStart(status, ExitCodeFor(status.code()));

  if (const std::optional<ProcedureRecord>& record = store_->interrupted()) {
    is_interrupted_ = true;
    interrupted_label_ = record->label;
    const bool may_resume = store_->MayResume(seconds(config_.procedure.resume_limit_s));
    Log(LogLevel::kWarning, "procedure_was_interrupted",
        {{"label", record->label}, {"resumes", may_resume ? "yes" : "no, waits to be told"}});
    if (may_resume && state_ == State::kIdle) {
      if (const Status status = Begin(record->label, true); !status.ok()) {
        trouble_ = "the interrupted procedure cannot go on: " + status.message();
        Log(LogLevel::kError, "cannot_resume", {{"what", status.message()}});
      }
    }
  } else if (config_.procedure.begin_at_start && state_ == State::kIdle) {
    if (const Status status = Begin("", false); !status.ok()) return FailStart(status, kExitInternal);
  }

  // Last: who can connect finds everything ready.
  Result<std::unique_ptr<ControlServer>> control =
      ControlServer::Create(runtime_folder + "/control", kSharedMode, *group, {},
                            [this](auto client, const ControlPeer& peer, const ControlRequest& request) {
                              return Handle(client, peer, request);
                            });
  if (!control.ok()) return FailStart(control.status(), kExitIo);
  control_ = std::move(*control);
  ring_->SetService(Service());
  notifier_.Ready(OneLine());
  Log(LogLevel::kInfo, "ready", {{"source", config_.source.path}, {"state", OneLine()}});
  return kExitOk;
}

Status Daemon::PrepareProcedure() {
  state_ = State::kWaitingForSource;
  next_source_try_ = clock_.Now() + kSourceRetry;
  Result<std::unique_ptr<FrameSource>> source = OpenSource(config_.source);
  if (!source.ok()) {
    const bool may_come = source.code() == StatusCode::kNotFound || source.code() == StatusCode::kUnavailable;
    if (!IsCamera(config_.source) || !may_come) return source.status();
    trouble_ = source.status().message();
    return Status::Ok();
  }
  Result<std::unique_ptr<Procedure>> procedure =
      Procedure::Prepare(config_, std::move(*source), {clock_, *ring_, files_, [this] { Wake(); }});
  if (!procedure.ok()) return procedure.status();
  procedure_ = std::move(*procedure);
  state_ = State::kIdle;
  return Status::Ok();
}

Status Daemon::Begin(const std::string& label, bool is_resumed) {
  if (is_resumed && store_->has_checkpoint()) HAUSTRA_TRY(procedure_->Load(store_->checkpoint_path()));
  label_ = label;
  checkpoint_error_.clear();
  // A disk that is full costs what a crash would lose, not the procedure.
  if (const Status status = store_->WriteOpen(label_); !status.ok()) {
    checkpoint_error_ = status.message();
    Log(LogLevel::kWarning, "procedure_not_recorded", {{"what", status.message()}});
  }
  is_interrupted_ = false;
  last_checkpoint_.reset();
  ring_->SetProcedure(++number_);
  ring_->PublishEvent(ProcedureEvent(HAUSTRA_EVENT_PROCEDURE_BEGUN, number_));
  procedure_->Start(number_, earlier_);
  state_ = State::kRunning;
  next_checkpoint_ = clock_.Now() + seconds(config_.checkpoint.interval_s);
  Log(LogLevel::kInfo, is_resumed ? "procedure_resumed" : "procedure_begun",
      {{"procedure", std::to_string(number_)}, {"label", label_}});
  return Status::Ok();
}

Result<std::string> Daemon::End(bool keep) {
  std::string kept_as;
  if (procedure_ != nullptr && is_open()) {
    procedure_->Stop();
    notifier_.FeedWatchdog();
    state_ = State::kStopped;
  }
  if (keep) {
    const std::string base = label_.empty() ? "procedure" : label_;
    kept_as = base;
    for (int i = 2; store_->has_saved(kept_as); ++i) kept_as = base + "-" + std::to_string(i);
    Status status;
    if (is_interrupted_) {
      status = store_->has_checkpoint() ? store_->KeepCheckpoint(kept_as) : NotFound("there is no checkpoint to keep");
    } else {
      procedure_->Save(store_->saved_path(kept_as), [&status](const Status& saved) { status = saved; });
      files_.Finish();
      notifier_.FeedWatchdog();
    }
    if (!status.ok()) {
      trouble_ = "data not kept: " + status.message();
      return Unavailable(trouble_ + "; nothing was wiped: end again, or `end wipe`");
    }
  }
  const bool was_open = is_open();
  if (was_open) {
    earlier_ = procedure_->counts();
    procedure_.reset();
  }
  files_.Do(WipeThisThread);
  files_.Finish();
  TakeSaved();
  WipeThisThread();
  ReturnFreeMemory();
  ring_->Wipe();
  ring_->PublishEvent(ProcedureEvent(HAUSTRA_EVENT_PROCEDURE_ENDED, number_));
  const Status wiped = store_->Close();
  notifier_.FeedWatchdog();
  Log(LogLevel::kInfo, "procedure_ended",
      {{"procedure", std::to_string(number_)}, {"label", label_}, {"kept_as", kept_as}});
  label_.clear();
  interrupted_label_.clear();
  is_interrupted_ = false;
  trouble_ = wiped.ok() ? "" : wiped.message();
  if (was_open) {
    if (const Status status = PrepareProcedure(); !status.ok()) {
      Log(LogLevel::kError, "cannot_prepare", {{"what", status.message()}});
      exit_code_ = ExitCodeFor(status.code());
    }
  }
  notifier_.FeedWatchdog();
  if (!wiped.ok()) return Unavailable("the procedure has ended, but " + wiped.message());
  return keep ? "kept as " + kept_as + "\n" : std::string("wiped\n");
}

int Daemon::Loop(int signals) {
  while (true) {
    std::array<pollfd, 3> events{{{signals, POLLIN, 0}, {wake_, POLLIN, 0}, {control_->descriptor(), POLLIN, 0}}};
    ::poll(events.data(), events.size(), 50);
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
    TakeSaved();
    if (!HandleSignals(signals)) break;
    control_->Serve(clock_.Now());
    Tick(clock_.Now());
    if (exit_code_ != kExitOk) break;
  }
  Stop();
  return exit_code_;
}

bool Daemon::HandleSignals(int signals) {
  signalfd_siginfo info{};
  while (::read(signals, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
    switch (info.ssi_signo) {
      case SIGHUP: Reload(); break;
      case SIGUSR1: {
        const std::string text = MetricsText(clock_.Now());
        for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) {
          const std::string line = text.substr(at, text.find('\n', at) - at);
          if (!line.starts_with('#')) Log(LogLevel::kInfo, "metric", {{"line", line}});
        }
        break;
      }
      default: Log(LogLevel::kInfo, "stopping"); return false;
    }
  }
  return true;
}

void Daemon::Tick(TimePoint now) {
  ring_->Beat();
  ring_->SetService(Service());
  if (state_ == State::kWaitingForSource && now >= next_source_try_) {
    if (const Status status = PrepareProcedure(); !status.ok()) {
      Log(LogLevel::kError, "cannot_prepare", {{"what", status.message()}});
      exit_code_ = ExitCodeFor(status.code());
      return;
    }
    if (state_ == State::kIdle) {
      trouble_.clear();
      Log(LogLevel::kInfo, "source_found", {{"source", config_.source.path}});
      const bool may_resume = is_interrupted_ && store_->MayResume(seconds(config_.procedure.resume_limit_s));
      if (may_resume || (!is_interrupted_ && config_.procedure.begin_at_start && number_ == 0)) {
        if (const Status status = Begin(interrupted_label_, may_resume); !status.ok()) trouble_ = status.message();
      }
    }
  }
  std::string hang;
  if (state_ == State::kRunning) {
    if (const std::optional<Status> ended = procedure_->ended()) {
      Log(LogLevel::kError, "session_ended", {{"what", ended->ToString()}});
      exit_code_ = ExitCodeFor(ended->code());
      return;
    }
    hang = FindHang(procedure_->signs(), now, config_.watchdog);
    ConsiderCheckpoint(now);
  }
  if (hang.empty() != hang_.empty()) {
    Log(hang.empty() ? LogLevel::kInfo : LogLevel::kError, hang.empty() ? "goes_on" : "hang", {{"what", hang}});
  }
  hang_ = hang;
  if (hang_.empty() && now >= next_feed_) {
    // Four times in the limit; a service nobody watches says it every second, to nobody.
    const Duration limit = notifier_.watchdog_limit();
    next_feed_ = now + (limit.count() > 0 ? limit / 4 : Duration(seconds(1)));
    notifier_.FeedWatchdog();
  }
  notifier_.Status(OneLine());
}

void Daemon::ConsiderCheckpoint(TimePoint now) {
  if (config_.checkpoint.interval_s == 0 || now < next_checkpoint_ || is_checkpoint_under_way_) return;
  next_checkpoint_ = now + seconds(config_.checkpoint.interval_s);
  if (procedure_->has_changed()) {
    is_checkpoint_under_way_ = true;
    StartSave(store_->checkpoint_path(), std::nullopt);
    return;
  }
  // Nothing new, but the procedure goes on: that is what decides whether it may resume by itself.
  files_.Do([this, label = label_] { (void)store_->WriteOpen(label); });
}

void Daemon::StartSave(const std::string& path, std::optional<ControlServer::ClientId> client) {
  procedure_->Save(path, [this, path, client, label = label_](Status status) {
    if (status.ok() && !client) status = store_->WriteOpen(label);
    {
      const std::lock_guard lock(saved_mutex_);
      saved_.push_back({std::move(status), path, client, clock_.Now()});
    }
    Wake();
  });
}

void Daemon::TakeSaved() {
  std::vector<SaveDone> saved;
  {
    const std::lock_guard lock(saved_mutex_);
    saved.swap(saved_);
  }
  for (const SaveDone& done : saved) {
    if (done.client) {
      Log(done.status.ok() ? LogLevel::kInfo : LogLevel::kWarning, done.status.ok() ? "maps_saved" : "maps_not_saved",
          {{"file", done.path}, {"what", done.status.message()}});
      control_->Reply(
          *done.client,
          done.status.ok() ? Result<std::string>("saved " + done.path + "\n") : Result<std::string>(done.status),
          clock_.Now());
      continue;
    }
    is_checkpoint_under_way_ = false;
    if (done.status.ok()) {
      ++earlier_.checkpoints;
      last_checkpoint_ = done.at;
    } else {
      ++earlier_.checkpoints_failed;
      // Once for each reason: a full disk stays full for a while.
      if (checkpoint_error_ != done.status.message()) {
        Log(LogLevel::kWarning, "checkpoint_failed", {{"what", done.status.message()}});
      }
    }
    checkpoint_error_ = done.status.message();
  }
}

void Daemon::Reload() {
  notifier_.Reloading();
  const Result<ConfigStore<DaemonConfig>> loaded = LoadDaemonConfig(config_source_.path, config_source_.assignments);
  if (!loaded.ok()) {
    Log(LogLevel::kError, "reload_refused", {{"what", loaded.status().message()}});
  } else {
    const ConfigChange change = ApplyLive(config_, loaded->config());
    config_ = change.config;
    needs_restart_ = change.needs_restart;
    SetLogLevel(LogLevelFrom(config_.log.level));
    if (procedure_ != nullptr) procedure_->SetSnapshotInterval(milliseconds(config_.publish.snapshot_interval_ms));
    next_checkpoint_ = std::min(next_checkpoint_, clock_.Now() + seconds(config_.checkpoint.interval_s));
    Log(LogLevel::kInfo, "reloaded", {{"changed", Joined(change.applied)}, {"needs_restart", Joined(needs_restart_)}});
  }
  notifier_.Ready(OneLine());
}

void Daemon::Stop() {
  notifier_.Stopping("stopping");
  if (state_ == State::kRunning) {
    procedure_->Stop();
    files_.Finish();
    StartSave(store_->checkpoint_path(), std::nullopt);
    files_.Finish();
    TakeSaved();
    Log(checkpoint_error_.empty() ? LogLevel::kInfo : LogLevel::kError, "procedure_stopped",
        {{"label", label_}, {"checkpoint", checkpoint_error_.empty() ? "written" : checkpoint_error_}});
    if (!checkpoint_error_.empty() && exit_code_ == kExitOk) exit_code_ = kExitIo;
  }
  control_.reset();
  procedure_.reset();
  ring_.reset();
  Log(LogLevel::kInfo, "stopped");
}

std::optional<Result<std::string>> Daemon::Handle(ControlServer::ClientId client, const ControlPeer& peer,
                                                  const ControlRequest& request) {
  if (request.command == ControlCommand::kStatus) return StatusText(clock_.Now());
  if (request.command == ControlCommand::kMetrics) return MetricsText(clock_.Now());
  Log(LogLevel::kInfo, "request",
      {{"what", ToText(request)}, {"uid", std::to_string(peer.uid)}, {"pid", std::to_string(peer.pid)}});
  switch (request.command) {
    case ControlCommand::kBegin:
    case ControlCommand::kResume: {
      const bool is_resume = request.command == ControlCommand::kResume;
      if (is_open()) return FailedPrecondition("a procedure is open: end it first");
      if (is_resume && !is_interrupted_) return FailedPrecondition("no procedure was interrupted");
      if (!is_resume && is_interrupted_) {
        return FailedPrecondition("an interrupted procedure" +
                                  (interrupted_label_.empty() ? "" : " '" + interrupted_label_ + "'") +
                                  " is on the disk: resume or end it first");
      }
      if (state_ == State::kWaitingForSource) return Unavailable("there is no camera: " + trouble_);
      if (const Status status = Begin(is_resume ? interrupted_label_ : request.name, is_resume); !status.ok()) {
        return status;
      }
      return "procedure " + std::to_string(number_) + "\n";
    }
    case ControlCommand::kEnd:
      if (!is_open() && !is_interrupted_) return FailedPrecondition("no procedure is open");
      return End(request.keep.value_or(config_.procedure.keep_data));
    case ControlCommand::kSave:
      if (!is_open()) return FailedPrecondition("no procedure is open");
      if (store_->has_saved(request.name)) return FailedPrecondition("there is a save of that name");
      StartSave(store_->saved_path(request.name), client);
      return std::nullopt;
    default: return Internal("not handled");
  }
}

ProcedureCounts Daemon::counts() const {
  ProcedureCounts counts = procedure_ != nullptr && is_open() ? procedure_->counts() : earlier_;
  counts.checkpoints = earlier_.checkpoints;
  counts.checkpoints_failed = earlier_.checkpoints_failed;
  return counts;
}

haustra_service Daemon::Service() const {
  if (state_ != State::kRunning) return HAUSTRA_SERVICE_IDLE;
  switch (procedure_->signal()) {
    case SignalState::kFrames: return HAUSTRA_SERVICE_RUNNING;
    case SignalState::kOver: return HAUSTRA_SERVICE_SOURCE_OVER;
    case SignalState::kWaiting:
    case SignalState::kNone: return HAUSTRA_SERVICE_NO_SIGNAL;
  }
  return HAUSTRA_SERVICE_NO_SIGNAL;
}

std::string Daemon::OneLine() const {
  std::string text;
  switch (state_) {
    case State::kWaitingForSource: text = "waiting for the camera"; break;
    case State::kIdle: text = is_interrupted_ ? "idle: an interrupted procedure waits" : "idle: no procedure"; break;
    case State::kStopped: text = "stopped: data not kept yet"; break;
    case State::kRunning: {
      text = Service() == HAUSTRA_SERVICE_NO_SIGNAL ? "procedure " + std::to_string(number_) + ": waiting for signal"
             : Service() == HAUSTRA_SERVICE_SOURCE_OVER
                 ? "procedure " + std::to_string(number_) + ": the recording is over"
                 : "procedure " + std::to_string(number_) + ": running";
    }
  }
  if (!hang_.empty()) text += "; a thread hangs";
  if (!checkpoint_error_.empty()) text += "; checkpoints fail";
  return text;
}

std::string Daemon::StatusText(TimePoint now) const {
  ServiceStatus status;
  status.summary = OneLine();
  status.service = Service();
  status.is_waiting_for_source = state_ == State::kWaitingForSource;
  status.is_stopped = state_ == State::kStopped;
  status.is_open = is_open();
  status.procedure = number_;
  status.label = is_open() ? label_ : interrupted_label_;
  status.is_interrupted = is_interrupted_;
  status.uptime = now - started_;
  if (last_checkpoint_) status.checkpoint_age = now - *last_checkpoint_;
  status.checkpoint_error = checkpoint_error_;
  status.hang = hang_;
  status.trouble = trouble_;
  status.needs_restart = Joined(needs_restart_);
  return ToStatusText(status, counts());
}

std::string Daemon::MetricsText(TimePoint now) const {
  ServiceMetrics metrics;
  metrics.service = Service();
  metrics.uptime = now - started_;
  metrics.procedures = number_;
  metrics.is_open = is_open();
  metrics.is_hanging = !hang_.empty();
  if (last_checkpoint_) metrics.checkpoint_age = now - *last_checkpoint_;
  metrics.clients = control_ == nullptr ? 0 : control_->num_clients();
  metrics.clients_refused = control_ == nullptr ? 0 : control_->num_refused();
  metrics.requests_malformed = control_ == nullptr ? 0 : control_->num_malformed();
  metrics.capacity = config_.engine.memory;
  return ToMetricsText(metrics, counts());
}

}  // namespace haustra
