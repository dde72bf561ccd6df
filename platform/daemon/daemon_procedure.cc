// How haustrad begins and ends a procedure, and what it does when its threads or its device fail (daemon.h).
#include <poll.h>
#include <unistd.h>

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
  if (state_ == State::kRunning) {
    StopThreads();
    state_ = State::kStopped;
  }
  if (keep) {
    const std::string base = label_.empty() ? "procedure" : label_;
    kept_as = base;
    for (int i = 2; store_->has_saved(kept_as); ++i) kept_as = base + "-" + std::to_string(i);
    Status status;
    if (is_interrupted_ || !has_maps()) {
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
    earlier_ = WithoutProcedure(counts());
    if (!is_given_up_) procedure_.reset();
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
  is_interrupted_ = is_device_recreated_ = false;
  trouble_ = wiped.ok() ? "" : wiped.message();
  if (is_given_up_) {
    // What it still holds of the procedure goes with the process.
    state_ = State::kIdle;
    exit_code_ = kExitUnavailable;
  } else if (was_open) {
    if (const Status status = PrepareProcedure(); !status.ok()) {
      Log(LogLevel::kError, "cannot_prepare", {{"what", status.message()}});
      exit_code_ = ExitCodeFor(status.code());
    }
  }
  notifier_.FeedWatchdog();
  if (!wiped.ok()) return Unavailable("the procedure has ended, but " + wiped.message());
  return keep ? "kept as " + kept_as + "\n" : std::string("wiped\n");
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

bool Daemon::StopThreads() {
  const TimePoint limit = clock_.Now() + milliseconds(config_.watchdog.stop_limit_ms);
  procedure_->RequestStop();
  while (!procedure_->has_stopped() && clock_.Now() < limit) {
    pollfd wake{wake_, POLLIN, 0};
    ::poll(&wake, 1, 10);
    std::uint64_t count = 0;
    [[maybe_unused]] const ssize_t read = ::read(wake_, &count, sizeof count);
    ring_->Beat();
    notifier_.FeedWatchdog();
  }
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
  procedure_.reset();
  is_interrupted_ = true;
  interrupted_label_ = label_;
  if (const Status status = PrepareProcedure(); !status.ok()) {
    Log(LogLevel::kError, "cannot_prepare", {{"what", status.message()}});
    return status;
  }
  Log(LogLevel::kWarning, "device_recreated", {{"label", label_}});
  // Without a camera it goes on when that is back.
  return state_ == State::kIdle ? Begin(label_, true) : Status::Ok();
}

void Daemon::Stop() {
  notifier_.Stopping("stopping");
  if (state_ == State::kRunning) {
    StopThreads();
    files_.Finish();
    if (has_maps()) {
      StartSave(store_->checkpoint_path(), std::nullopt);
      files_.Finish();
      TakeSaved();
    } else {
      checkpoint_error_ = "the vision device does not give the maps; an earlier checkpoint stands";
    }
    Log(checkpoint_error_.empty() ? LogLevel::kInfo : LogLevel::kError, "procedure_stopped",
        {{"label", label_}, {"checkpoint", checkpoint_error_.empty() ? "written" : checkpoint_error_}});
    if (!checkpoint_error_.empty() && exit_code_ == kExitOk) exit_code_ = has_maps() ? kExitIo : kExitUnavailable;
  }
  control_.reset();
  if (is_given_up_) {
    ring_->Close();
  } else {
    procedure_.reset();
    ring_.reset();
  }
  Log(LogLevel::kInfo, "stopped");
}

}  // namespace haustra
