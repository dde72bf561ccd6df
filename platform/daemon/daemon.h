// haustrad: the supervisor. It has the two sockets, the state folder, the pose ring's header and the word with the
// service manager, and opens neither camera nor GPU. A worker (worker.h), a process of its own for each procedure, does
// the rest. service_state.h says what follows what; here is the input and the output.
//
// Threads: the service thread (this class) and one for what may wait for the disk. The service thread waits for neither
// disk nor worker, and for the starter of workers (worker_starter.h) a second at most.
#pragma once

#include <array>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "capture/files/file_sink.h"
#include "hal/clock.h"
#include "platform/control/control_server.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/file_worker.h"
#include "platform/daemon/procedure_counts.h"
#include "platform/daemon/procedure_number.h"
#include "platform/daemon/procedure_store.h"
#include "platform/daemon/service_notifier.h"
#include "platform/daemon/service_state.h"
#include "platform/daemon/worker_process.h"
#include "platform/publish/depth_table_writer.h"
#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/view_ring_writer.h"

namespace haustra {

// Where the configuration came from, for a reload.
struct ConfigSource {
  std::string path;
  std::vector<std::string> assignments;
};

class Daemon {
 public:
  // `start_worker` makes a process that runs RunWorker; a test puts one with scripted parts in its place.
  Daemon(const DaemonConfig& config, ConfigSource config_source, const Clock& clock, WorkerStarter start_worker);
  // Kills a worker that there still is.
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  // From start to stop; the exit code (platform/exit_codes.h). Signals that mean something to it must be blocked in all
  // threads (BlockSignals) before any other thread was made. The worker ends with the calling thread.
  int Run();

  // SIGTERM and SIGINT stop, SIGHUP reloads, SIGUSR1 writes the metrics to the log. SIGPIPE is ignored, here and in the
  // programs that are started: a log that nobody reads any more ends nothing.
  static sigset_t BlockSignals();

 private:
  struct Held {
    ControlServer::ClientId client = 0;
    ControlRequest request;
    std::uint64_t procedure = 0;  // that it is meant for
  };
  enum class SaveKind { kCheckpoint, kNamed, kKeep, kFinal };
  struct Save {
    SaveKind kind = SaveKind::kCheckpoint;
    std::string path;
    std::optional<ControlServer::ClientId> client;
    std::shared_ptr<FileSink> sink;
    std::uint64_t num_changes = 0;  // that it has, when written
    std::string kept_as;            // kKeep, when committed
  };

  // Everything before the worker; kExitOk, or the code to end with.
  int SetUp();
  // Poses, and view and depth where they are asked for; else what a former run left of them is removed.
  Status MakePublishedFiles(gid_t group);
  int Loop(int signals);
  void WaitForSomething(int signals) const;
  void HandleSignals(int signals);
  // Sockets, and word to the manager, when the first worker is ready or waits. kExitOk, or the code to end with.
  int Open();
  void Tick(TimePoint now);
  void Reload();
  void Leave();

  // The table, and what it asks for.
  void Tell(ServiceEvent event);
  void Tell(ServiceEventKind kind) { Tell(ServiceEvent{kind}); }
  void Do(ServiceAction action);
  void Enter(ServicePhase phase);
  // From now on the phase may take its limit.
  void ArmLimit();
  std::optional<Duration> LimitOf(ServicePhase phase) const;

  // The worker. daemon_procedure.cc has these and the actions.
  void StartNextWorker();
  void SendToWorker(const WorkerRequest& request, std::span<const int> files = {});
  void SendSettings();
  void HearWorker();
  void Hear(const WorkerReport& report);
  void HearOfSignal();
  void Fault(const std::string& what);
  void TakeLeaveOfWorker(const std::string& how);
  void WatchWorker(TimePoint now);

  void LoadCheckpoint();
  void RecordOpen();
  void BeginWorker();
  void KeepMaps();
  void KeepCheckpoint();
  void Wipe();
  void RecordStopped();
  void Answer(bool is_done);
  void ConsiderCheckpoint(TimePoint now);
  void StartSave(SaveKind kind, const std::string& path, std::optional<ControlServer::ClientId> client = {});
  void Commit(const WorkerReport& report);
  // Its last reference wipes what it wrote, and waits for the disk: not here.
  void Discard(std::shared_ptr<FileSink> sink);
  void EndSave(const Save& save, const Status& status);
  void AskOfMarks(const Held& held);
  void AnswerOfMarks(const WorkerReport& report);

  // `job` runs where it may wait for the disk; what it returns runs here.
  void DoFile(std::function<std::function<void()>()> job);
  void TakePosts();
  void Wake() const;

  std::optional<Result<std::string>> Handle(ControlServer::ClientId client, const ControlPeer& peer,
                                            const ControlRequest& request);
  void HandleHeld();
  // Whether somebody still waits for the answer; the log tells when not.
  bool IsWanted(const Held& held) const;
  // Why a request cannot be now.
  Status Refusal(const Held& held) const;
  std::string StatusText(TimePoint now) const;
  std::string MetricsText(TimePoint now) const;
  // What somebody should look at; empty: nothing.
  std::string Trouble() const;
  std::string OneLine() const;
  ProcedureCounts counts() const;
  haustra_service Service() const;
  // A stop that was ordered is not forgotten by what is written after it.
  RecordedState state_to_record() const { return is_to_end_ ? RecordedState::kStopped : RecordedState::kRunning; }
  // Of the newest procedure.
  std::uint64_t number() const { return ProcedureNumber(run_, num_procedures_); }
  std::string name_to_keep() const { return label_.empty() ? "procedure" : label_; }
  bool is_open() const { return state_.procedure == ProcedurePhase::kOpen; }
  bool is_interrupted() const { return state_.procedure == ProcedurePhase::kInterrupted; }

  DaemonConfig config_;
  ConfigSource config_source_;
  const Clock& clock_;
  const WorkerStarter start_worker_;
  ServiceNotifier notifier_;
  int wake_ = -1;
  TimePoint started_;

  std::unique_ptr<ProcedureStore> store_;
  std::unique_ptr<PoseRingWriter> ring_;
  std::unique_ptr<ViewRingWriter> view_;     // null unless publish.view
  std::unique_ptr<DepthTableWriter> depth_;  // null unless publish.depth
  std::unique_ptr<ControlServer> lookout_;   // answers status and metrics
  std::unique_ptr<ControlServer> control_;

  ServiceState state_;
  std::deque<ServiceEvent> events_;
  bool is_telling_ = false;
  std::optional<TimePoint> phase_limit_;
  bool may_begin_by_itself_ = true;  // once, when the first worker is ready
  // Somebody has ended a procedure in this run of the service. Also when it could not be wiped it does not resume by
  // itself.
  bool was_ended_ = false;
  bool is_to_end_ = false;

  std::unique_ptr<WorkerProcess> worker_;
  std::uint64_t num_workers_ = 0;
  bool is_worker_dismissed_ = false;  // in order, or of no further use: how it ends is no news
  std::string device_;                // on which its worker sees; empty: none is ready
  TimePoint last_heard_;
  WorkerReport report_;        // the last one
  bool has_signs_ = false;     // of the running procedure, in report_
  std::string signal_logged_;  // why there was none, as the log has it; empty: it has that there is one
  TimePoint next_signal_log_;
  std::string waits_for_;  // what the worker, or one before it, said; as the log has it; empty: there is a camera
  std::uint64_t num_faults_ = 0;
  std::string last_fault_;

  std::deque<Held> held_;                         // requests that wait their turn, one of each client at most
  std::optional<ControlServer::ClientId> asker_;  // of what is under way
  ControlRequest asked_;
  Status failure_;                // why it failed
  Status wiped_;                  // the last `end`
  bool is_keeping_maps_ = false;  // what comes of it is not known: the checkpoint is not touched
  std::string kept_as_;
  std::string kept_from_;  // the checkpoint, where maps that are newer could not be kept; empty: nothing is missing

  std::string label_;                 // of the open or interrupted procedure
  std::uint64_t run_ = 0;             // of the service (procedure_number.h)
  std::uint64_t num_procedures_ = 0;  // that it has begun
  bool is_resumed_ = false;
  ProcedureCounts earlier_;    // of the workers that have gone
  std::string trouble_;        // what the last end or resume left to look at, until something begins; empty: nothing
  std::string needs_restart_;  // keys, with commas
  TimePoint next_feed_;
  TimePoint next_checkpoint_;
  std::optional<TimePoint> last_checkpoint_;
  std::string checkpoint_error_;
  std::string final_checkpoint_ = "an earlier one stands";
  // This procedure wrote the checkpoint, or was resumed from it. Set by the job that puts it into place, so that who
  // finds the file knows.
  std::atomic<bool> has_own_checkpoint_{false};
  bool is_checkpoint_under_way_ = false;
  std::uint64_t checkpoint_changes_ = 0;  // of the worker's changes, those that the last checkpoint has
  std::map<std::uint64_t, Save> saves_;   // that the worker writes
  std::uint64_t num_saves_ = 0;
  std::map<std::uint64_t, ControlServer::ClientId> mark_askers_;  // that the worker has not answered
  std::uint64_t num_mark_requests_ = 0;
  std::set<std::string> saves_under_way_;  // paths that somebody asked for

  int num_file_jobs_ = 0;
  TimePoint file_job_since_;
  std::mutex posts_mutex_;
  std::vector<std::function<void()>> posts_;
  FileWorker files_;  // last: its jobs use the others
};

}  // namespace haustra
