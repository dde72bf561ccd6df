// What haustrad does with its worker and its files (daemon.h).
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "capture/files/owned_descriptor.h"
#include "engine/mapping/mark_keeper.h"
#include "platform/daemon/daemon.h"
#include "platform/daemon/health.h"
#include "platform/daemon/log.h"
#include "platform/daemon/supervised_source.h"
#include "platform/exit_codes.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// Then the rest has its turn, even when the worker sends without end.
constexpr int kMaxReportsAtATime = 100;
constexpr Duration kSignalLogInterval = seconds(1);

haustra_event ProcedureEvent(haustra_event_kind kind, std::uint64_t number) {
  haustra_event event{};
  event.published_ns = haustra_now_ns();
  event.procedure = number;
  event.kind = kind;
  event.map_id = event.other_map_id = HAUSTRA_NO_MAP;
  return event;
}

Status WithPath(const std::string& path, const Status& status) {
  return status.ok() ? status : Status(status.code(), path + ": " + status.message());
}

}  // namespace

// --- The worker.

void Daemon::StartNextWorker() {
  ArmLimit();  // also where one worker follows another in the same phase
  report_ = {};
  is_worker_dismissed_ = has_signs_ = false;
  signal_logged_.clear();
  last_heard_ = clock_.Now();
  ++num_workers_;
  Result<std::unique_ptr<WorkerProcess>> started = WorkerProcess::Start(start_worker_);
  const OwnedDescriptor configuration{::memfd_create("haustra configuration", MFD_CLOEXEC)};
  // Files come to it open: it is not told where they lie.
  DaemonConfig of_worker = config_;
  of_worker.files = {};
  const std::string text = PrintDaemonConfig(of_worker);
  const bool is_written = configuration.value >= 0 &&
                          ::write(configuration.value, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  if (!started.ok() || !is_written) {
    Log(LogLevel::kError, "no_worker", {{"what", started.ok() ? "no memory file" : started.status().message()}});
    return Tell(ServiceEventKind::kWorkerGone);
  }
  worker_ = std::move(*started);
  Log(LogLevel::kInfo, "worker_started", {{"pid", std::to_string(worker_->pid())}});
  std::vector<int> files{configuration.value, ring_->descriptor()};
  if (view_ != nullptr) files.push_back(view_->descriptor());
  if (depth_ != nullptr) files.push_back(depth_->descriptor());
  SendToWorker({.command = WorkerCommand::kPrepare}, files);
  SendSettings();
}

void Daemon::SendSettings() {
  if (worker_ == nullptr) return;
  WorkerRequest settings{.command = WorkerCommand::kSettings};
  settings.log_level = static_cast<std::uint32_t>(LogLevelFrom(config_.log.level));
  settings.snapshot_interval_ns = Duration(milliseconds(config_.publish.snapshot_interval_ms)).count();
  settings.work_limit_ns = Duration(milliseconds(config_.watchdog.work_limit_ms)).count();
  SendToWorker(settings);
}

void Daemon::SendToWorker(const WorkerRequest& request, std::span<const int> files) {
  // When it has gone, that is heard by itself.
  if (worker_ != nullptr) (void)worker_->Send(request, files);
}

void Daemon::HearWorker() {
  if (worker_ == nullptr) return;
  // Before its last words are read: they are there by then.
  const std::optional<std::string> how = worker_->Reap();
  for (int i = 0; i < kMaxReportsAtATime || how; ++i) {
    const Result<WorkerReport> report = worker_->Receive();
    if (report.ok()) {
      last_heard_ = clock_.Now();
      Hear(*report);
    } else if (report.code() == StatusCode::kDataLoss) {
      if (!is_worker_dismissed_) Fault(report.status().message());
    } else {
      break;
    }
    if (worker_ == nullptr) return;
  }
  if (!how) return;
  TakeLeaveOfWorker(*how);
  Tell(ServiceEventKind::kWorkerGone);
}

void Daemon::TakeLeaveOfWorker(const std::string& how) {
  if (!is_worker_dismissed_) {
    ++num_faults_;
    last_fault_ = "the worker ended: " + how;
    failure_ = Unavailable(last_fault_);
    Log(LogLevel::kError, "worker_ended", {{"how", how}, {"pid", std::to_string(worker_->pid())}});
  }
  worker_.reset();
  device_.clear();
  earlier_ = WithoutProcedure(Sum(earlier_, report_.counts));
  report_ = {};
  std::map<std::uint64_t, ControlServer::ClientId> mark_askers;
  mark_askers.swap(mark_askers_);
  for (const auto& [number, client] : mark_askers) {
    if (control_ != nullptr) control_->Reply(client, Unavailable("the worker ended"), clock_.Now());
  }
  std::map<std::uint64_t, Save> saves;
  saves.swap(saves_);
  for (auto& [number, save] : saves) {
    // That file is of no use. The disk is waited for elsewhere.
    Discard(std::exchange(save.sink, nullptr));
    // Of what is under way the end of the worker is the news.
    if (save.kind == SaveKind::kKeep) is_keeping_maps_ = false;
    if (save.kind != SaveKind::kKeep && save.kind != SaveKind::kFinal) {
      EndSave(save, Unavailable(save.path + ": the worker ended"));
    }
  }
}

void Daemon::Fault(const std::string& what) {
  ++num_faults_;
  last_fault_ = what;
  failure_ = Unavailable(what);
  is_worker_dismissed_ = true;
  Log(LogLevel::kError, "worker_fails", {{"what", what}, {"during", std::string(ToString(state_.phase))}});
  Tell(ServiceEventKind::kFault);
}

void Daemon::Hear(const WorkerReport& report) {
  switch (report.news) {
    case WorkerNews::kAlive:
      report_ = report;
      has_signs_ = true;
      return HearOfSignal();
    case WorkerNews::kWaits:
      // It looks once a second.
      if (waits_for_ != report.text.data()) {
        waits_for_ = report.text.data();
        Log(LogLevel::kWarning, "waiting_for_source", {{"source", config_.source.path}, {"what", waits_for_}});
      }
      if (state_.phase == ServicePhase::kWaiting) ArmLimit();
      return Tell(ServiceEventKind::kWorkerWaits);
    case WorkerNews::kReady:
      if (!waits_for_.empty()) {
        waits_for_.clear();
        Log(LogLevel::kInfo, "source_found", {{"source", config_.source.path}});
      }
      device_ = report.text.data();
      Log(LogLevel::kInfo, "worker_ready", {{"device", device_}});
      return Tell(ServiceEventKind::kWorkerReady);
    case WorkerNews::kFails:
      failure_ = report.status();
      Log(LogLevel::kError, control_ == nullptr ? "cannot_start" : "cannot_prepare", {{"what", failure_.message()}});
      return Tell({ServiceEventKind::kWorkerFails, ExitCodeFor(failure_.code())});
    case WorkerNews::kLoaded:
      if (report.code == 0) return Tell(ServiceEventKind::kLoaded);
      failure_ = WithPath(store_->checkpoint_path(), report.status());
      return Tell(ServiceEventKind::kNotLoaded);
    case WorkerNews::kBegun: return Tell(ServiceEventKind::kBegun);
    case WorkerNews::kStopped:
      report_ = report;
      if (report.fault == WorkerFault::kNone) return Tell(ServiceEventKind::kStoppedWithMaps);
      Log(LogLevel::kError, "maps_lost", {{"what", "the vision device has failed"}});
      return Tell(ServiceEventKind::kStoppedWithoutMaps);
    case WorkerNews::kSaved: return Commit(report);
    case WorkerNews::kMarked: return AnswerOfMarks(report);
    case WorkerNews::kSessionEnds:
      if (is_worker_dismissed_) return;
      report_ = report;
      if (report.fault == WorkerFault::kLost) return Fault("the vision device is lost");
      if (report.fault == WorkerFault::kHung) return Fault("the vision device hangs");
      Log(LogLevel::kError, "session_ended", {{"what", report.status().message()}});
      return Tell(
          {ServiceEventKind::kSessionEnds, report.code == 0 ? kExitInternal : ExitCodeFor(report.status().code())});
  }
}

// Once in kSignalLogInterval at most: a plug with a loose contact does not fill the log.
void Daemon::HearOfSignal() {
  if (state_.phase != ServicePhase::kRunning || last_heard_ < next_signal_log_) return;
  const std::string why = report_.text.data();
  const bool has_signal = static_cast<SignalState>(report_.signal) == SignalState::kFrames;
  if (has_signal ? signal_logged_.empty() : why.empty() || why == signal_logged_) return;
  if (has_signal) {
    Log(LogLevel::kInfo, "signal_is_back", {{"source", config_.source.path}});
  } else {
    Log(LogLevel::kWarning, "no_signal", {{"source", config_.source.path}, {"what", why}});
  }
  signal_logged_ = has_signal ? "" : why;
  next_signal_log_ = last_heard_ + kSignalLogInterval;
}

void Daemon::WatchWorker(TimePoint now) {
  if (worker_ == nullptr || is_worker_dismissed_) return;
  // The start has a limit of its own.
  if (state_.phase == ServicePhase::kStarting) return;
  if (now - last_heard_ > Duration(milliseconds(config_.watchdog.worker_limit_ms))) {
    return Fault("the worker gives no sign of life");
  }
  if (state_.phase != ServicePhase::kRunning || !has_signs_) return;
  const auto last = [&](int i) { return last_heard_ - Duration(report_.silence_ns[static_cast<std::size_t>(i)]); };
  const std::string hang = FindHang({last(0), last(1), last(2), last(3)}, last_heard_, config_.watchdog);
  if (!hang.empty()) Fault(hang);
}

// --- The procedure.

void Daemon::LoadCheckpoint() {
  is_resumed_ = true;
  if (state_.purpose == ServicePurpose::kResume) has_own_checkpoint_ = true;
  // After what is on its way to the disk: the worker that has gone may have left a checkpoint there.
  DoFile([this, worker = num_workers_]() -> std::function<void()> {
    const std::string path = store_->checkpoint_path();
    const bool has_one = has_own_checkpoint_ && store_->has_checkpoint();
    const auto file =
        std::make_shared<OwnedDescriptor>(has_one ? ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW) : -1);
    return [this, worker, path, has_one, file] {
      if (state_.phase != ServicePhase::kLoading || worker != num_workers_) return;
      if (!has_one) return Tell(ServiceEventKind::kLoaded);
      if (file->value >= 0) return SendToWorker({.command = WorkerCommand::kLoad}, std::array{file->value});
      failure_ = Unavailable(path + ": cannot be read");
      Tell(ServiceEventKind::kNotLoaded);
    };
  });
}

void Daemon::RecordOpen() {
  if (asked_.command == ControlCommand::kBegin && state_.purpose == ServicePurpose::kBegin) {
    is_resumed_ = has_own_checkpoint_ = false;
  }
  DoFile([this, label = label_, state = state_to_record()]() -> std::function<void()> {
    return [this, recorded = store_->WriteOpen(label, state)] {
      // A disk that is full costs what a crash would lose, not the procedure.
      checkpoint_error_ = recorded.message();
      if (!recorded.ok()) Log(LogLevel::kWarning, "procedure_not_recorded", {{"what", recorded.message()}});
      Tell(ServiceEventKind::kRecorded);
    };
  });
}

void Daemon::BeginWorker() {
  last_checkpoint_.reset();
  is_checkpoint_under_way_ = false;
  checkpoint_changes_ = 0;
  trouble_.clear();
  ++num_procedures_;
  ring_->SetProcedure(number());
  ring_->PublishEvent(ProcedureEvent(HAUSTRA_EVENT_PROCEDURE_BEGUN, number()));
  SendToWorker({.command = WorkerCommand::kBegin, .number = number()});
}

void Daemon::KeepMaps() {
  kept_from_.clear();
  is_keeping_maps_ = true;
  StartSave(SaveKind::kKeep, store_->saved_path(name_to_keep()));
}

void Daemon::KeepCheckpoint() {
  ArmLimit();  // the worker that had one may have gone
  // They are newer. EndSave comes back here if they do not come to the disk.
  if (is_keeping_maps_) return;
  kept_from_.clear();
  // Of an interrupted procedure there is nothing else.
  if (!is_interrupted()) kept_from_ = "its last checkpoint";
  if (!is_interrupted() && last_checkpoint_) {
    const double age_s = std::round(ToSeconds(clock_.Now() - *last_checkpoint_));
    kept_from_ = "the checkpoint of " + std::to_string(static_cast<int>(age_s)) + " s before";
  }
  DoFile([this, name = name_to_keep(), is_found = is_interrupted()]() -> std::function<void()> {
    const bool has_one = (is_found || has_own_checkpoint_) && store_->has_checkpoint();
    const Result<std::string> kept =
        has_one ? store_->KeepCheckpoint(name) : Result<std::string>(NotFound("there is no checkpoint to keep"));
    return [this, kept] {
      failure_ = kept.status();
      if (kept.ok()) kept_as_ = *kept;
      Tell(kept.ok() ? ServiceEventKind::kKept : ServiceEventKind::kNotKept);
    };
  });
}

void Daemon::Wipe() {
  DoFile([this, label = label_]() -> std::function<void()> {
    const Status closed = store_->Close();
    // Somebody has ended it: it does not go on by itself, whatever comes.
    if (!closed.ok()) (void)store_->MarkStopped(label);
    return [this, wiped = closed] {
      wiped_ = wiped;
      ring_->Wipe();
      if (view_ != nullptr) view_->Wipe();
      if (depth_ != nullptr) depth_->Wipe();
      ring_->PublishEvent(ProcedureEvent(HAUSTRA_EVENT_PROCEDURE_ENDED, number()));
      if (!wiped.ok()) Log(LogLevel::kError, "procedure_not_wiped", {{"label", label_}, {"what", wiped.message()}});
      Log(LogLevel::kInfo, "procedure_ended",
          {{"procedure", std::to_string(number())},
           {"label", label_},
           {"kept_as", asked_.keep.value_or(false) ? kept_as_ : ""},
           {"kept_from", asked_.keep.value_or(false) ? kept_from_ : ""}});
      if (wiped.ok()) label_.clear();
      trouble_ = wiped.message();
      if (wiped.ok() && asked_.keep.value_or(false) && !kept_from_.empty()) {
        trouble_ = "only " + kept_from_ + " could be kept, as " + kept_as_;
      }
      checkpoint_error_.clear();
      last_checkpoint_.reset();
      Tell(wiped.ok() ? ServiceEventKind::kWiped : ServiceEventKind::kNotWiped);
    };
  });
}

void Daemon::RecordStopped() {
  DoFile([this, label = label_]() -> std::function<void()> {
    // Somebody stopped it in order, and somebody is to say what becomes of the procedure.
    return [this, recorded = store_->MarkStopped(label)] {
      if (!recorded.ok()) Log(LogLevel::kError, "stop_not_recorded", {{"what", recorded.message()}});
      // Elsewhere it would pass for the news of another record.
      if (state_.phase == ServicePhase::kClosing) Tell(ServiceEventKind::kRecorded);
    };
  });
}

void Daemon::Answer(bool is_done) {
  Result<std::string> answer = std::string();
  if (asked_.command == ControlCommand::kEnd) {
    if (is_done) {
      const std::string from = kept_from_.empty() ? "" : " from " + kept_from_;
      answer = *asked_.keep ? "kept as " + kept_as_ + from + "\n" : std::string("wiped\n");
      if (!wiped_.ok()) answer = Unavailable("nothing runs any more, but " + wiped_.message() + "; end again");
    } else {
      trouble_ = "data not kept: " + failure_.message();
      answer = Unavailable(trouble_ + "; nothing was wiped: end again, or `end wipe`");
    }
  } else if (is_done) {
    answer = "procedure " + std::to_string(number()) + "\n";
  } else {
    answer = failure_.ok() ? Unavailable("no worker could do it") : failure_;
    if (!asker_) {
      trouble_ = "the interrupted procedure cannot go on: " + answer.status().message();
      Log(LogLevel::kError, "cannot_resume", {{"what", answer.status().message()}});
    }
  }
  if (asker_ && control_ != nullptr) control_->Reply(*asker_, answer, clock_.Now());
  asker_.reset();
}

// --- Files that the worker writes.

void Daemon::ConsiderCheckpoint(TimePoint now) {
  if (config_.checkpoint.interval_s == 0 || now < next_checkpoint_ || is_checkpoint_under_way_) return;
  next_checkpoint_ = now + seconds(config_.checkpoint.interval_s);
  if (report_.num_changes != checkpoint_changes_) {
    is_checkpoint_under_way_ = true;
    StartSave(SaveKind::kCheckpoint, store_->checkpoint_path());
    return;
  }
  // Nothing new, but the procedure goes on: that is what decides whether it may resume by itself.
  DoFile([this, label = label_, state = state_to_record()] {
    (void)store_->WriteOpen(label, state);
    return nullptr;
  });
}

void Daemon::StartSave(SaveKind kind, const std::string& path, std::optional<ControlServer::ClientId> client) {
  Save save;
  save.kind = kind;
  save.path = path;
  save.client = client;
  const bool is_checkpoint = kind == SaveKind::kCheckpoint || kind == SaveKind::kFinal;
  const FormerFile former = is_checkpoint ? FormerFile::kWiped : FormerFile::kStays;
  DoFile([this, save, former, worker = num_workers_]() mutable -> std::function<void()> {
    Result<FileSink> created = FileSink::Create(save.path, former);
    const Status status = created.status();
    if (created.ok()) save.sink = std::make_shared<FileSink>(std::move(*created));
    return [this, save, status, worker]() mutable {
      if (!status.ok()) return EndSave(save, status);
      // Saves end with their worker. Of the one at the stop that end is the news.
      if (worker_ == nullptr || worker != num_workers_) {
        Discard(std::exchange(save.sink, nullptr));
        if (save.kind != SaveKind::kFinal) EndSave(save, Unavailable(save.path + ": the worker ended"));
        return;
      }
      const std::uint64_t number = ++num_saves_;
      const int file = save.sink->descriptor();
      saves_.emplace(number, std::move(save));
      SendToWorker({.command = WorkerCommand::kSave, .number = number}, std::array{file});
    };
  });
}

void Daemon::AskOfMarks(const Held& held) {
  const std::uint64_t number = ++num_mark_requests_;
  mark_askers_[number] = held.client;
  WorkerRequest request;
  request.command = held.request.command == ControlCommand::kMark     ? WorkerCommand::kMark
                    : held.request.command == ControlCommand::kUnmark ? WorkerCommand::kUnmark
                                                                      : WorkerCommand::kListMarks;
  request.number = number;
  request.frame_index = held.request.frame_index.value_or(kNewestFrame);
  request.pixel = {held.request.x_px, held.request.y_px};
  std::copy(held.request.name.begin(), held.request.name.end(), request.label.begin());
  SendToWorker(request);
}

void Daemon::AnswerOfMarks(const WorkerReport& report) {
  const auto it = mark_askers_.find(report.number);
  if (it == mark_askers_.end()) return;
  const Result<std::string> answer =
      report.code == 0 ? Result<std::string>(std::string(report.text.data())) : Result<std::string>(report.status());
  if (control_ != nullptr) control_->Reply(it->second, answer, clock_.Now());
  mark_askers_.erase(it);
}

void Daemon::Discard(std::shared_ptr<FileSink> sink) {
  DoFile([sink = std::move(sink)]() mutable {
    sink.reset();
    return nullptr;
  });
}

void Daemon::Commit(const WorkerReport& report) {
  const auto it = saves_.find(report.number);
  if (it == saves_.end()) return;
  Save save = std::move(it->second);
  saves_.erase(it);
  save.num_changes = report.num_changes;
  const Status written = WithPath(save.path, report.status());
  DoFile([this, save = std::move(save), written, label = label_, name = name_to_keep(),
          state = state_to_record()]() mutable -> std::function<void()> {
    Status status = written;
    if (status.ok() && save.kind == SaveKind::kKeep) {
      // Chosen here: files that were on their way to the disk are in place by now.
      save.kept_as = store_->FreeName(name);
      status = save.sink->CommitAs(store_->saved_path(save.kept_as));
    } else if (status.ok()) {
      status = save.sink->Commit();
    }
    if (status.ok() && save.path == store_->checkpoint_path()) has_own_checkpoint_ = true;
    save.sink.reset();
    if (status.ok() && save.kind == SaveKind::kCheckpoint) status = store_->WriteOpen(label, state);
    return [this, save, status] { EndSave(save, status); };
  });
}

void Daemon::EndSave(const Save& save, const Status& status) {
  if (save.kind == SaveKind::kNamed) {
    saves_under_way_.erase(save.path);
    Log(status.ok() ? LogLevel::kInfo : LogLevel::kWarning, status.ok() ? "maps_saved" : "maps_not_saved",
        {{"file", save.path}, {"what", status.message()}});
    if (control_ == nullptr) return;
    control_->Reply(*save.client,
                    status.ok() ? Result<std::string>("saved " + save.path + "\n") : Result<std::string>(status),
                    clock_.Now());
    return;
  }
  if (save.kind == SaveKind::kKeep) {
    is_keeping_maps_ = false;
    // Who had them has gone meanwhile.
    if (!status.ok() && !state_.has_worker) return KeepCheckpoint();
    failure_ = status;
    if (status.ok()) kept_as_ = save.kept_as;
    return Tell(status.ok() ? ServiceEventKind::kKept : ServiceEventKind::kNotKept);
  }
  is_checkpoint_under_way_ = false;
  if (status.ok()) {
    ++earlier_.checkpoints;
    checkpoint_changes_ = save.num_changes;
    last_checkpoint_ = clock_.Now();
  } else {
    ++earlier_.checkpoints_failed;
    // Once for each reason: a full disk stays full for a while.
    if (checkpoint_error_ != status.message()) {
      Log(LogLevel::kWarning, "checkpoint_failed", {{"what", status.message()}});
    }
  }
  checkpoint_error_ = status.message();
  if (save.kind != SaveKind::kFinal) return;
  final_checkpoint_ = status.ok() ? "written" : status.message();
  Tell(status.ok() ? ServiceEventKind::kKept : ServiceEventKind::kNotKept);
}

}  // namespace haustra
