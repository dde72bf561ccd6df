// How haustrad begins and ends a procedure, and what it does when its threads or its device fail (daemon.h).
#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <exception>
#include <utility>

#include "platform/daemon/daemon.h"
#include "platform/daemon/log.h"
#include "platform/daemon/open_source.h"
#include "platform/daemon/wipe_memory.h"
#include "platform/exit_codes.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kSourceRetry = seconds(1);

haustra_event ProcedureEvent(haustra_event_kind kind, std::uint64_t number) {
  haustra_event event{};
  event.published_ns = haustra_now_ns();
  event.procedure = number;
  event.kind = kind;
  event.map_id = event.other_map_id = HAUSTRA_NO_MAP;
  return event;
}

}  // namespace

Status Daemon::PrepareProcedure() {
  Status status;
  Aside([&] { status = OpenAndPrepare(); });
  return status;
}

Status Daemon::OpenAndPrepare() {
  state_ = State::kWaitingForSource;
  next_source_try_ = clock_.Now() + kSourceRetry;
  Result<std::unique_ptr<FrameSource>> source = parts_.open_source(config_.source);
  if (!source.ok()) {
    const bool may_come = source.code() == StatusCode::kNotFound || source.code() == StatusCode::kUnavailable;
    if (!IsCamera(config_.source) || !may_come) return source.status();
    trouble_ = source.status().message();
    return Status::Ok();
  }
  Result<std::unique_ptr<Procedure>> procedure =
      Procedure::Prepare(config_, std::move(*source), {clock_, *ring_, files_, parts_.make_device, [this] { Wake(); }});
  if (!procedure.ok()) return procedure.status();
  procedure_ = std::move(*procedure);
  state_ = State::kIdle;
  return Status::Ok();
}

Status Daemon::Begin(const std::string& label, bool is_resumed) {
  Status loaded, recorded;
  Aside([&] {
    if (is_resumed && store_->has_checkpoint()) loaded = procedure_->Load(store_->checkpoint_path());
    if (loaded.ok()) recorded = store_->WriteOpen(label, RecordedState::kRunning);
  });
  HAUSTRA_TRY(loaded);
  label_ = label;
  // A disk that is full costs what a crash would lose, not the procedure.
  checkpoint_error_ = recorded.message();
  if (!recorded.ok()) Log(LogLevel::kWarning, "procedure_not_recorded", {{"what", recorded.message()}});
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
  if (state_ == State::kRunning) {
    StopThreads();
    state_ = State::kStopped;
  }
  if (keep) {
    const std::string base = label_.empty() ? "procedure" : label_;
    kept_as = base;
    for (int i = 2; store_->has_saved(kept_as); ++i) kept_as = base + "-" + std::to_string(i);
    Status status;
    Aside([&] { status = Keep(kept_as); });
    if (!status.ok()) {
      trouble_ = "data not kept: " + status.message();
      return Unavailable(trouble_ + "; nothing was wiped: end again, or `end wipe`");
    }
  }
  const bool was_open = is_open();
  if (was_open) earlier_ = WithoutProcedure(counts());
  Aside([&] {
    if (was_open && !is_given_up_) procedure_.reset();
    files_.Do(WipeThisThread);
    files_.Finish();
  });
  TakeSaved();
  WipeThisThread();
  Status wiped;
  Aside([&] {
    WipeThisThread();
    ReturnFreeMemory();
    wiped = store_->Close();
  });
  ring_->Wipe();
  ring_->PublishEvent(ProcedureEvent(HAUSTRA_EVENT_PROCEDURE_ENDED, number_));
  Log(LogLevel::kInfo, "procedure_ended",
      {{"procedure", std::to_string(number_)}, {"label", label_}, {"kept_as", kept_as}});
  label_.clear();
  interrupted_label_.clear();
  is_interrupted_ = is_device_recreated_ = false;
  trouble_ = wiped.ok() ? "" : wiped.message();
  if (is_given_up_) {
    // What it still holds of the procedure goes with the process.
    state_ = State::kIdle;
    exit_code_ = kExitUnavailable;
  } else if (was_open) {
    if (const Status status = PrepareProcedure(); !status.ok()) {
      Log(LogLevel::kError, "cannot_prepare", {{"what", status.ToString()}});
      exit_code_ = ExitCodeFor(status.code());
    }
  }
  if (!wiped.ok()) return Unavailable("the procedure has ended, but " + wiped.message());
  return keep ? "kept as " + kept_as + "\n" : std::string("wiped\n");
}

Status Daemon::Keep(const std::string& name) {
  if (is_interrupted_ || !has_maps()) {
    return store_->has_checkpoint() ? store_->KeepCheckpoint(name) : NotFound("there is no checkpoint to keep");
  }
  Status status;
  procedure_->Save(store_->saved_path(name), [&status](const Status& saved) { status = saved; });
  files_.Finish();
  return status;
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
  files_.Do([this, label = label_] { (void)store_->WriteOpen(label, RecordedState::kRunning); });
}

void Daemon::StartSave(const std::string& path, std::optional<ControlServer::ClientId> client) {
  procedure_->Save(path, [this, path, client, label = label_](Status status) {
    if (status.ok() && !client) status = store_->WriteOpen(label, RecordedState::kRunning);
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
      saves_under_way_.erase(done.path);
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

bool Daemon::has_maps() const {
  return procedure_ != nullptr && !is_given_up_ && procedure_->fault() == WatchedVisionDevice::Fault::kNone;
}

void Daemon::ShowLife() {
  pollfd wake{wake_, POLLIN, 0};
  ::poll(&wake, 1, 10);
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
  ring_->Beat();
  notifier_.FeedWatchdog();
  if (lookout_ != nullptr) lookout_->Serve(clock_.Now());
}

void Daemon::Aside(const std::function<void()>& job) {
  std::atomic<bool> is_done{false};
  std::exception_ptr thrown;
  if (lookout_ != nullptr) frozen_ = {StatusText(clock_.Now()) + "busy yes\n", MetricsText(clock_.Now())};
  aside_.Do([&] {
    try {
      job();
    } catch (...) {
      thrown = std::current_exception();
    }
    is_done.store(true, std::memory_order_release);
  });
  const TimePoint limit = clock_.Now() + milliseconds(config_.watchdog.work_limit_ms);
  while (!is_done.load(std::memory_order_acquire) && clock_.Now() < limit) ShowLife();
  aside_.Finish();
  frozen_.reset();
  if (thrown) std::rethrow_exception(thrown);
}

bool Daemon::StopThreads() {
  const TimePoint limit = clock_.Now() + milliseconds(config_.watchdog.stop_limit_ms);
  procedure_->RequestStop();
  while (!procedure_->has_stopped() && clock_.Now() < limit) ShowLife();
  const bool has_stopped = procedure_->has_stopped();
  if (has_stopped) procedure_->Stop();
  // To destroy a device that hangs is to wait for it.
  is_given_up_ = !has_stopped || procedure_->fault() == WatchedVisionDevice::Fault::kHung;
  if (is_given_up_) {
    Log(LogLevel::kError, "given_up", {{"what", has_stopped ? "the vision device hangs" : "a thread does not end"}});
  }
  return has_stopped;
}

Status Daemon::RecreateDevice() {
  is_device_recreated_ = true;
  procedure_->Stop();
  earlier_ = WithoutProcedure(counts());
  Aside([this] { procedure_.reset(); });
  is_interrupted_ = true;
  interrupted_label_ = label_;
  if (const Status status = PrepareProcedure(); !status.ok()) {
    Log(LogLevel::kError, "cannot_prepare", {{"what", status.ToString()}});
    return status;
  }
  Log(LogLevel::kWarning, "device_recreated", {{"label", label_}});
  // Without a camera it goes on when that is back.
  return state_ == State::kIdle ? Begin(label_, true) : Status::Ok();
}

void Daemon::Stop() {
  notifier_.Stopping("stopping");
  // In kStopped, too: its data were to be kept.
  if (is_open()) {
    if (state_ == State::kRunning) StopThreads();
    Aside([this] {
      files_.Finish();
      if (has_maps()) StartSave(store_->checkpoint_path(), std::nullopt);
      files_.Finish();
      // Somebody stopped it in order, and somebody is to say what becomes of the procedure.
      if (exit_code_ == kExitOk && !is_given_up_) (void)store_->WriteOpen(label_, RecordedState::kStopped);
    });
    TakeSaved();
    if (!has_maps()) {
      checkpoint_error_ = "the vision device does not give the maps; an earlier checkpoint stands";
    }
    Log(checkpoint_error_.empty() ? LogLevel::kInfo : LogLevel::kError, "procedure_stopped",
        {{"label", label_}, {"checkpoint", checkpoint_error_.empty() ? "written" : checkpoint_error_}});
    if (!checkpoint_error_.empty() && exit_code_ == kExitOk) exit_code_ = has_maps() ? kExitIo : kExitUnavailable;
  }
  control_.reset();
  lookout_.reset();
  if (is_given_up_) {
    ring_->Close();
  } else {
    Aside([this] { procedure_.reset(); });
    ring_.reset();
  }
  Log(LogLevel::kInfo, "stopped");
}

}  // namespace haustra
