#include "platform/daemon/daemon.h"

#include <grp.h>
#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "platform/daemon/log.h"
#include "platform/daemon/status_text.h"
#include "platform/exit_codes.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr mode_t kSharedMode = 0660;    // sockets
constexpr mode_t kReadableMode = 0640;  // poses

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

Daemon::Daemon(const DaemonConfig& config, ConfigSource config_source, const Clock& clock, WorkerStarter start_worker)
    : config_(config),
      config_source_(std::move(config_source)),
      clock_(clock),
      start_worker_(std::move(start_worker)),
      wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      started_(clock.Now()) {}

Daemon::~Daemon() {
  worker_.reset();
  files_.Finish();
  if (wake_ >= 0) ::close(wake_);
}

sigset_t Daemon::BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1}) sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
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
  FillFolders(&config_.files);
  const std::string& state_folder = config_.files.state_folder;
  if (state_folder.empty() || config_.files.runtime_folder.empty()) {
    return FailStart(FailedPrecondition("files.state_folder and files.runtime_folder must be set (systemd does it by "
                                        "StateDirectory= and RuntimeDirectory=)"),
                     kExitConfig);
  }
  if (config_.source.path.empty()) return FailStart(FailedPrecondition("source.path is not set"), kExitConfig);
  const Result<gid_t> group = GroupOf("publish.group", config_.publish.group);
  if (!group.ok()) return FailStart(group.status(), kExitConfig);
  if (const Result<gid_t> control = GroupOf("control.group", config_.control.group); !control.ok()) {
    return FailStart(control.status(), kExitConfig);
  }

  const Result<std::uint64_t> run = DrawRun();
  if (!run.ok()) return FailStart(run.status(), kExitSystem);
  run_ = *run;
  Result<std::unique_ptr<ProcedureStore>> store = ProcedureStore::Open(state_folder);
  if (!store.ok()) {
    return FailStart(store.status(), store.code() == StatusCode::kFailedPrecondition ? kExitBusy : kExitIo);
  }
  store_ = std::move(*store);
  if (const Status made = MakePublishedFiles(*group); !made.ok()) return FailStart(made, kExitIo);

  if (const std::optional<ProcedureRecord>& record = store_->interrupted()) {
    state_.procedure = ProcedurePhase::kInterrupted;
    label_ = record->label;
    const bool may_resume = store_->MayResume(seconds(config_.procedure.resume_limit_s));
    Log(LogLevel::kWarning, "procedure_was_interrupted",
        {{"label", record->label}, {"resumes", may_resume ? "yes" : "no, waits to be told"}});
  }
  return kExitOk;
}

Status Daemon::MakePublishedFiles(gid_t group) {
  const std::string& folder = config_.files.runtime_folder;
  HAUSTRA_ASSIGN(ring_, PoseRingWriter::Create(folder + "/poses", kReadableMode, group));
  if (config_.publish.view) {
    HAUSTRA_ASSIGN(view_, ViewRingWriter::Create(folder + "/view", kReadableMode, group));
  } else {
    HAUSTRA_TRY(ViewRingWriter::RemoveFormer(folder + "/view"));
  }
  if (config_.publish.depth) {
    const auto num_slots = static_cast<std::uint32_t>(config_.engine.memory.max_keyframes);
    HAUSTRA_ASSIGN(depth_, DepthTableWriter::Create(folder + "/depth", kReadableMode, group, num_slots));
  } else {
    HAUSTRA_TRY(DepthTableWriter::RemoveFormer(folder + "/depth"));
  }
  return Status::Ok();
}

int Daemon::Open() {
  // Known since SetUp.
  const Result<gid_t> group = GroupOf("publish.group", config_.publish.group);
  const Result<gid_t> control_group =
      config_.control.group.empty() ? group : GroupOf("control.group", config_.control.group);
  if (!group.ok() || !control_group.ok())
    return FailStart(group.ok() ? control_group.status() : group.status(), kExitConfig);
  const auto serve = [&](std::string_view name, gid_t owners, const ControlLimits& limits) {
    return ControlServer::Create(config_.files.runtime_folder + "/" + std::string(name), kSharedMode, owners, limits,
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

void Daemon::WaitForSomething(int signals) const {
  std::array<pollfd, 6> events;
  std::size_t num = 0;
  const auto add = [&](int descriptor) { events[num++] = {descriptor, POLLIN, 0}; };
  add(signals);
  add(wake_);
  if (control_ != nullptr) add(lookout_->descriptor());
  if (control_ != nullptr) add(control_->descriptor());
  if (worker_ != nullptr) add(worker_->channel());
  if (worker_ != nullptr) add(worker_->process_descriptor());
  ::poll(events.data(), num, 50);
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
}

int Daemon::Loop(int signals) {
  Tell(ServiceEventKind::kStart);
  while (true) {
    TakePosts();
    HearWorker();
    HandleSignals(signals);
    if (state_.phase == ServicePhase::kReady && may_begin_by_itself_) {
      may_begin_by_itself_ = false;
      asker_.reset();
      if (is_interrupted() && !was_ended_ && store_->MayResume(seconds(config_.procedure.resume_limit_s))) {
        asked_ = {ControlCommand::kResume, "", {}};
        Tell(ServiceEventKind::kResume);
      } else if (!is_interrupted() && config_.procedure.begin_at_start) {
        asked_ = {ControlCommand::kBegin, "", {}};
        label_.clear();
        Tell(ServiceEventKind::kBegin);
      }
    }
    // Last: who can connect finds everything ready.
    if (control_ == nullptr && TakesRequests(state_.phase)) {
      if (const int code = Open(); code != kExitOk) return code;
    }
    if (control_ != nullptr) {
      lookout_->Serve(clock_.Now());
      control_->Serve(clock_.Now());
      HandleHeld();
    }
    Tick(clock_.Now());
    if (is_to_end_ && TakesTerminate(state_.phase)) Tell(ServiceEventKind::kTerminate);
    if (state_.phase == ServicePhase::kOver) break;
    WaitForSomething(signals);
  }
  Leave();
  return state_.exit_code;
}

void Daemon::HandleSignals(int signals) {
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
      default:
        if (is_to_end_) break;
        is_to_end_ = true;
        Log(LogLevel::kInfo, "stopping");
        notifier_.Stopping("stopping");
        if (!TakesTerminate(state_.phase)) Tell(ServiceEventKind::kTerminate);
    }
  }
}

void Daemon::Tell(ServiceEvent event) {
  events_.push_back(event);
  if (is_telling_) return;
  is_telling_ = true;
  while (!events_.empty()) {
    const ServiceEvent next = events_.front();
    events_.pop_front();
    const ServiceStep step = Next(state_, next);
    const ServicePhase before = std::exchange(state_, step.state).phase;
    if (state_.phase != before) Enter(state_.phase);
    Log(LogLevel::kDebug, "state",
        {{"event", std::string(ToString(next.kind))}, {"state", std::string(ToString(state_.phase))}});
    for (const ServiceAction action : step.actions) Do(action);
  }
  is_telling_ = false;
}

std::optional<Duration> Daemon::LimitOf(ServicePhase phase) const {
  switch (phase) {
    case ServicePhase::kStarting:
    case ServicePhase::kWaiting:  // from one look for the camera to the next, or to the engine
    case ServicePhase::kLoading:
    case ServicePhase::kBeginning: return milliseconds(config_.watchdog.work_limit_ms);
    case ServicePhase::kKeeping:
      if (!state_.has_worker) return std::nullopt;
      return milliseconds(config_.watchdog.work_limit_ms);
    case ServicePhase::kStopping:
    case ServicePhase::kReaping: return milliseconds(config_.watchdog.stop_limit_ms);
    default: return std::nullopt;
  }
}

void Daemon::ArmLimit() {
  const std::optional<Duration> limit = LimitOf(state_.phase);
  phase_limit_.reset();
  if (limit) phase_limit_ = clock_.Now() + *limit;
}

void Daemon::Enter(ServicePhase phase) {
  ArmLimit();
  if (phase == ServicePhase::kRunning) {
    has_signs_ = false;
    next_checkpoint_ = clock_.Now() + seconds(config_.checkpoint.interval_s);
    Log(LogLevel::kInfo, is_resumed_ ? "procedure_resumed" : "procedure_begun",
        {{"procedure", std::to_string(number())}, {"label", label_}});
  }
}

void Daemon::Do(ServiceAction action) {
  switch (action) {
    case ServiceAction::kStartWorker: return StartNextWorker();
    case ServiceAction::kLoad: return LoadCheckpoint();
    case ServiceAction::kRecordOpen: return RecordOpen();
    case ServiceAction::kBeginWorker: return BeginWorker();
    case ServiceAction::kStopWorker: return SendToWorker({.command = WorkerCommand::kStop});
    case ServiceAction::kKeepMaps: return KeepMaps();
    case ServiceAction::kKeepCheckpoint: return KeepCheckpoint();
    case ServiceAction::kSaveCheckpoint: return StartSave(SaveKind::kFinal, store_->checkpoint_path());
    case ServiceAction::kKillWorker:
      is_worker_dismissed_ = true;
      if (worker_ != nullptr) worker_->Kill();
      return;
    case ServiceAction::kWipe: return Wipe();
    case ServiceAction::kRecordStopped: return RecordStopped();
    case ServiceAction::kSayDone: return Answer(true);
    case ServiceAction::kSayFailed: return Answer(false);
    case ServiceAction::kLeave: return;
  }
}

void Daemon::Tick(TimePoint now) {
  ring_->Beat();
  ring_->SetService(Service());
  if (phase_limit_ && now >= *phase_limit_) {
    phase_limit_.reset();
    const std::string what = "not done in time: " + std::string(ToString(state_.phase));
    Log(LogLevel::kError, "time_is_up", {{"what", what}});
    failure_ = Unavailable("the worker has " + what);
    last_fault_ = what;
    if (state_.phase == ServicePhase::kReaping && worker_ != nullptr) {
      worker_->LetGo();
      TakeLeaveOfWorker("");
    }
    Tell(ServiceEventKind::kTimeUp);
  }
  WatchWorker(now);
  if (state_.phase == ServicePhase::kRunning) ConsiderCheckpoint(now);
  const bool disk_hangs =
      num_file_jobs_ > 0 && now - file_job_since_ > Duration(milliseconds(config_.watchdog.work_limit_ms));
  if (!disk_hangs && now >= next_feed_) {
    // Four times within the limit of the service manager; without one the interval does not matter.
    const Duration limit = notifier_.watchdog_limit();
    next_feed_ = now + (limit.count() > 0 ? limit / 4 : Duration(seconds(1)));
    notifier_.FeedWatchdog();
  }
  if (control_ != nullptr && !is_to_end_) notifier_.Status(OneLine());
}

void Daemon::Reload() {
  notifier_.Reloading();
  const Result<ConfigStore<DaemonConfig>> loaded = LoadDaemonConfig(config_source_.path, config_source_.assignments);
  if (!loaded.ok()) {
    Log(LogLevel::kError, "reload_refused", {{"what", loaded.status().message()}});
  } else {
    DaemonConfig wanted = loaded->config();
    FillFolders(&wanted.files);
    const ConfigChange change = ApplyLive(config_, wanted);
    config_ = change.config;
    needs_restart_ = Joined(change.needs_restart);
    SetLogLevel(LogLevelFrom(config_.log.level));
    SendSettings();
    next_checkpoint_ = std::min(next_checkpoint_, clock_.Now() + seconds(config_.checkpoint.interval_s));
    Log(LogLevel::kInfo, "reloaded", {{"changed", Joined(change.applied)}, {"needs_restart", needs_restart_}});
  }
  if (control_ != nullptr) notifier_.Ready(OneLine());
}

void Daemon::Leave() {
  // What it still writes is not reported any more.
  worker_.reset();
  files_.Finish();
  TakePosts();
  if (is_open()) {
    Log(final_checkpoint_ == "written" ? LogLevel::kInfo : LogLevel::kError, "procedure_stopped",
        {{"label", label_}, {"checkpoint", final_checkpoint_}});
  }
  control_.reset();
  lookout_.reset();
  depth_.reset();
  view_.reset();
  ring_.reset();
  Log(LogLevel::kInfo, "stopped");
}

void Daemon::DoFile(std::function<std::function<void()>()> job) {
  if (num_file_jobs_++ == 0) file_job_since_ = clock_.Now();
  files_.Do([this, job = std::move(job)] {
    std::function<void()> then = job();
    {
      const std::lock_guard lock(posts_mutex_);
      posts_.push_back(std::move(then));
    }
    Wake();
  });
}

void Daemon::TakePosts() {
  std::vector<std::function<void()>> posts;
  {
    const std::lock_guard lock(posts_mutex_);
    posts.swap(posts_);
  }
  for (const std::function<void()>& post : posts) {
    --num_file_jobs_;
    file_job_since_ = clock_.Now();
    if (post) post();
  }
}

std::optional<Result<std::string>> Daemon::Handle(ControlServer::ClientId client, const ControlPeer& peer,
                                                  const ControlRequest& request) {
  if (request.command == ControlCommand::kStatus) return StatusText(clock_.Now());
  if (request.command == ControlCommand::kMetrics) return MetricsText(clock_.Now());
  Log(LogLevel::kInfo, "request",
      {{"what", ToText(request)}, {"uid", std::to_string(peer.uid)}, {"pid", std::to_string(peer.pid)}});
  // One for each client that is there, at most: their number has a limit.
  std::erase_if(held_, [this](const Held& held) { return !IsWanted(held); });
  held_.push_back({client, request, request.procedure.value_or(number())});
  return std::nullopt;
}

bool Daemon::IsWanted(const Held& held) const {
  if (control_->IsThere(held.client)) return true;
  Log(LogLevel::kWarning, "request_dropped", {{"what", ToText(held.request)}, {"why", "the client has gone"}});
  return false;
}

Status Daemon::Refusal(const Held& held) const {
  const ControlRequest& request = held.request;
  switch (request.command) {
    case ControlCommand::kBegin:
    case ControlCommand::kResume: {
      const bool is_resume = request.command == ControlCommand::kResume;
      if (is_open()) return FailedPrecondition("a procedure is open: end it first");
      if (is_resume && !is_interrupted()) return FailedPrecondition("no procedure was interrupted");
      if (!is_resume && is_interrupted()) {
        const std::string name = label_.empty() ? "" : " '" + label_ + "'";
        if (!wiped_.ok()) {
          return FailedPrecondition("the procedure" + name + " was not wiped: end it again first (" + wiped_.message() +
                                    ")");
        }
        return FailedPrecondition("an interrupted procedure" + name + " is on the disk: resume or end it first");
      }
      if (state_.phase == ServicePhase::kWaiting) return Unavailable("there is no camera: " + waits_for_);
      return Status::Ok();
    }
    case ControlCommand::kEnd:
      if (!is_open() && !is_interrupted()) return FailedPrecondition("no procedure is open");
      return Status::Ok();
    case ControlCommand::kMark:
    case ControlCommand::kMarks:
    case ControlCommand::kUnmark:
      if (!is_open()) return FailedPrecondition("no procedure is open");
      // Frames are numbered anew, and it may be another patient's.
      if (request.command != ControlCommand::kMarks && held.procedure != number()) {
        return FailedPrecondition("meant for procedure " + std::to_string(held.procedure) + ", but it is procedure " +
                                  std::to_string(number()) + " that is open now: nothing was done");
      }
      if (state_.phase != ServicePhase::kRunning) return Unavailable("nothing is tracked now");
      return Status::Ok();
    case ControlCommand::kSave:
      if (!is_open()) return FailedPrecondition("no procedure is open");
      if (state_.phase != ServicePhase::kRunning && !state_.has_maps) {
        return Unavailable("the maps cannot be read now; the last checkpoint stands");
      }
      if (store_->has_saved(request.name) || saves_under_way_.contains(store_->saved_path(request.name))) {
        return FailedPrecondition("there is a save of that name");
      }
      return Status::Ok();
    default: return Internal("not handled");
  }
}

void Daemon::HandleHeld() {
  while (!held_.empty() && TakesRequests(state_.phase)) {
    const Held held = held_.front();
    held_.pop_front();
    // A client that gave up may have done something else since: nothing begins or ends for it.
    if (!IsWanted(held)) continue;
    if (const Status refusal = Refusal(held); !refusal.ok()) {
      control_->Reply(held.client, refusal, clock_.Now());
      continue;
    }
    if (held.request.command == ControlCommand::kSave) {
      const std::string path = store_->saved_path(held.request.name);
      saves_under_way_.insert(path);
      StartSave(SaveKind::kNamed, path, held.client);
      continue;
    }
    if (IsAboutMarks(held.request.command)) {
      AskOfMarks(held);
      continue;
    }
    asker_ = held.client;
    asked_ = held.request;
    failure_ = Status::Ok();
    switch (held.request.command) {
      case ControlCommand::kBegin:
        label_ = held.request.name;
        Tell(ServiceEventKind::kBegin);
        break;
      case ControlCommand::kResume: Tell(ServiceEventKind::kResume); break;
      default:
        was_ended_ = true;
        asked_.keep = held.request.keep.value_or(config_.procedure.keep_data);
        Tell(*asked_.keep ? ServiceEventKind::kEndKeep : ServiceEventKind::kEndWipe);
    }
  }
}

}  // namespace haustra
