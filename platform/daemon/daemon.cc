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

#include "platform/assemble.h"
#include "platform/daemon/log.h"
#include "platform/daemon/open_source.h"
#include "platform/daemon/status_text.h"
#include "platform/daemon/wipe_memory.h"
#include "platform/exit_codes.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr mode_t kSharedMode = 0660;    // sockets
constexpr mode_t kReadableMode = 0640;  // poses

std::string FolderFrom(const std::string& configured, const char* variable) {
  if (!configured.empty()) return configured;
  const char* value = std::getenv(variable);
  // systemd gives a list when the unit names several.
  return value == nullptr ? std::string() : std::string(value).substr(0, std::string(value).find(':'));
}

Result<gid_t> GroupOf(const char* key, const std::string& name) {
  if (name.empty()) return static_cast<gid_t>(-1);
  const group* entry = ::getgrnam(name.c_str());
  if (entry == nullptr) return FailedPrecondition(std::string(key) + ": there is no group '" + name + "'");
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

}  // namespace

DaemonParts SystemParts() {
  return {OpenSource, [](const DaemonConfig& config, const CameraCalibration& calibration) {
            return CreateVisionDevice(config.vision.device, config.engine, calibration, config.vision.threads);
          }};
}

Daemon::Daemon(const DaemonConfig& config, ConfigSource config_source, const Clock& clock, DaemonParts parts)
    : config_(config),
      config_source_(std::move(config_source)),
      clock_(clock),
      parts_(std::move(parts)),
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
  const Result<gid_t> group = GroupOf("publish.group", config_.publish.group);
  if (!group.ok()) return FailStart(group.status(), kExitConfig);
  const Result<gid_t> control_group =
      config_.control.group.empty() ? group : GroupOf("control.group", config_.control.group);
  if (!control_group.ok()) return FailStart(control_group.status(), kExitConfig);

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
  const auto serve = [&](std::string_view name, gid_t owners, const ControlLimits& limits) {
    return ControlServer::Create(runtime_folder + "/" + std::string(name), kSharedMode, owners, limits,
                                 [this](auto client, const ControlPeer& peer, const ControlRequest& request) {
                                   return Handle(client, peer, request);
                                 });
  };
  ControlLimits looking;
  looking.only_looks = true;
  Result<std::unique_ptr<ControlServer>> lookout = serve(kStatusSocket, *group, looking);
  if (!lookout.ok()) return FailStart(lookout.status(), kExitIo);
  lookout_ = std::move(*lookout);
  Result<std::unique_ptr<ControlServer>> control = serve(kControlSocket, *control_group, {});
  if (!control.ok()) return FailStart(control.status(), kExitIo);
  control_ = std::move(*control);
  ring_->SetService(Service());
  notifier_.Ready(OneLine());
  Log(LogLevel::kInfo, "ready", {{"source", config_.source.path}, {"state", OneLine()}});
  return kExitOk;
}

int Daemon::Loop(int signals) {
  while (true) {
    std::array<pollfd, 4> events{{{signals, POLLIN, 0},
                                  {wake_, POLLIN, 0},
                                  {lookout_->descriptor(), POLLIN, 0},
                                  {control_->descriptor(), POLLIN, 0}}};
    ::poll(events.data(), events.size(), 50);
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
    TakeSaved();
    if (!HandleSignals(signals)) break;
    lookout_->Serve(clock_.Now());
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
  if (exit_code_ != kExitOk) return;
  ring_->Beat();
  ring_->SetService(Service());
  if (state_ == State::kWaitingForSource && now >= next_source_try_) {
    if (const Status status = PrepareProcedure(); !status.ok()) {
      Log(LogLevel::kError, "cannot_prepare", {{"what", status.ToString()}});
      exit_code_ = ExitCodeFor(status.code());
      return;
    }
    if (state_ == State::kIdle) {
      trouble_.clear();
      Log(LogLevel::kInfo, "source_found", {{"source", config_.source.path}});
      const bool may_resume =
          is_interrupted_ && (is_device_recreated_ || store_->MayResume(seconds(config_.procedure.resume_limit_s)));
      if (may_resume || (!is_interrupted_ && config_.procedure.begin_at_start && number_ == 0)) {
        if (const Status status = Begin(interrupted_label_, may_resume); !status.ok()) trouble_ = status.message();
      }
    }
  }
  std::string hang;
  if (state_ == State::kRunning) {
    if (const std::optional<Status> ended = procedure_->ended()) {
      Log(LogLevel::kError, "session_ended", {{"what", ended->ToString()}});
      const bool may_go_on =
          procedure_->fault() == WatchedVisionDevice::Fault::kLost && !is_device_recreated_ && RecreateDevice().ok();
      if (!may_go_on) exit_code_ = ExitCodeFor(ended->code());
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

void Daemon::Reload() {
  notifier_.Reloading();
  const Result<ConfigStore<DaemonConfig>> loaded = LoadDaemonConfig(config_source_.path, config_source_.assignments);
  if (!loaded.ok()) {
    Log(LogLevel::kError, "reload_refused", {{"what", loaded.status().message()}});
  } else {
    const ConfigChange change = ApplyLive(config_, loaded->config());
    config_ = change.config;
    needs_restart_ = Joined(change.needs_restart);
    SetLogLevel(LogLevelFrom(config_.log.level));
    if (procedure_ != nullptr) procedure_->SetSnapshotInterval(milliseconds(config_.publish.snapshot_interval_ms));
    next_checkpoint_ = std::min(next_checkpoint_, clock_.Now() + seconds(config_.checkpoint.interval_s));
    Log(LogLevel::kInfo, "reloaded", {{"changed", Joined(change.applied)}, {"needs_restart", needs_restart_}});
  }
  notifier_.Ready(OneLine());
}

std::optional<Result<std::string>> Daemon::Handle(ControlServer::ClientId client, const ControlPeer& peer,
                                                  const ControlRequest& request) {
  if (request.command == ControlCommand::kStatus) return frozen_ ? frozen_->status : StatusText(clock_.Now());
  if (request.command == ControlCommand::kMetrics) return frozen_ ? frozen_->metrics : MetricsText(clock_.Now());
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
      if (store_->has_saved(request.name) || saves_under_way_.contains(store_->saved_path(request.name))) {
        return FailedPrecondition("there is a save of that name");
      }
      saves_under_way_.insert(store_->saved_path(request.name));
      StartSave(store_->saved_path(request.name), client);
      return std::nullopt;
    default: return Internal("not handled");
  }
}

}  // namespace haustra
