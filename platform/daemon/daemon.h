// haustrad: one process, one procedure at a time.
//
//   waiting_for_source  there is no camera yet; it is looked for every second
//   idle                an engine stands ready, empty; nothing is looked at
//   running             a procedure
//   stopped             a procedure was to end with its data kept, and that failed: `end` again, or `end wipe`
//
// A vision device that is lost is made anew, once a procedure, and the procedure goes on from its last checkpoint. The
// second time, and when the device hangs, the service ends with kExitUnavailable; the last checkpoint stands.
//
// Threads: the service thread (this class; signals, control socket, watchdog), the session's (platform/session), the
// file worker, and one on which engines are made and a procedure's end is worked off. The service thread waits for none
// of them without showing that it lives.
#pragma once

#include <csignal>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "platform/control/control_server.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/file_worker.h"
#include "platform/daemon/procedure.h"
#include "platform/daemon/procedure_store.h"
#include "platform/daemon/service_notifier.h"
#include "platform/publish/pose_ring_writer.h"

namespace haustra {

// Where the configuration came from, for a reload.
struct ConfigSource {
  std::string path;
  std::vector<std::string> assignments;
};

// What a test puts something else in the place of.
struct DaemonParts {
  std::function<Result<std::unique_ptr<FrameSource>>(const SourceConfig&)> open_source;
  MakeVisionDevice make_device;
};
// Those that the configuration names.
DaemonParts SystemParts();

class Daemon {
 public:
  Daemon(const DaemonConfig& config, ConfigSource config_source, const Clock& clock, DaemonParts parts);
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  // From start to stop; the exit code (platform/exit_codes.h). Signals that mean something to it must be blocked in all
  // threads (BlockSignals) before any other thread was made.
  int Run();
  // After Run. A thread is stuck in a driver, or waits for a device that hangs: the destructor would wait for it, too.
  // The process is to end without one (std::_Exit); the kernel takes back its memory.
  bool is_given_up() const { return is_given_up_; }

  // SIGTERM and SIGINT stop, SIGHUP reloads, SIGUSR1 writes the metrics to the log.
  static sigset_t BlockSignals();

 private:
  enum class State { kWaitingForSource, kIdle, kRunning, kStopped };
  struct SaveDone {
    Status status;
    std::string path;
    std::optional<ControlServer::ClientId> client;  // none: a checkpoint
    TimePoint at;
  };

  // Everything before READY; kExitOk, or the code to end with.
  int SetUp();
  int Loop(int signals);
  // False: stop.
  bool HandleSignals(int signals);
  void Tick(TimePoint now);
  void Reload();
  void Stop();
  // Does it on a thread of its own, and shows meanwhile that the service lives, up to watchdog.work_limit_ms: what
  // waits for a disk or takes memory must not starve the watchdog. Meanwhile the socket that only looks is served, with
  // what held when the work began; nothing else is.
  void Aside(const std::function<void()>& job);
  void ShowLife();
  // False: a thread did not end in time, and the process is given up.
  bool StopThreads();
  // The maps can be read.
  bool has_maps() const;
  // A new device and a new engine, which goes on from the last checkpoint.
  Status RecreateDevice();

  // Makes an engine ready; kWaitingForSource when the camera is not there. Errors that waiting does not mend.
  Status PrepareProcedure();
  Status OpenAndPrepare();
  Status Begin(const std::string& label, bool is_resumed);
  Result<std::string> End(bool keep);
  // The maps of the stopped procedure, to saved/.
  Status Keep(const std::string& name);
  void ConsiderCheckpoint(TimePoint now);
  void TakeSaved();
  void StartSave(const std::string& path, std::optional<ControlServer::ClientId> client);

  std::optional<Result<std::string>> Handle(ControlServer::ClientId client, const ControlPeer& peer,
                                            const ControlRequest& request);
  std::string StatusText(TimePoint now) const;
  std::string MetricsText(TimePoint now) const;
  std::string OneLine() const;
  ProcedureCounts counts() const;
  haustra_service Service() const;
  void Wake() const;
  bool is_open() const { return state_ == State::kRunning || state_ == State::kStopped; }

  DaemonConfig config_;
  ConfigSource config_source_;
  const Clock& clock_;
  const DaemonParts parts_;
  ServiceNotifier notifier_;
  int wake_ = -1;
  TimePoint started_;

  std::unique_ptr<ProcedureStore> store_;
  std::unique_ptr<PoseRingWriter> ring_;
  std::unique_ptr<ControlServer> lookout_;  // answers status and metrics
  std::unique_ptr<ControlServer> control_;
  FileWorker files_;
  FileWorker aside_;
  struct Answers {
    std::string status;
    std::string metrics;
  };
  std::optional<Answers> frozen_;  // while the job of Aside has hold of everything else
  std::unique_ptr<Procedure> procedure_;

  State state_ = State::kWaitingForSource;
  bool is_interrupted_ = false;  // an earlier procedure waits on the disk
  std::string interrupted_label_;
  std::string label_;
  std::uint64_t number_ = 0;
  ProcedureCounts earlier_;  // of the procedures that have ended
  std::string trouble_;      // what somebody should look at; empty: nothing
  std::string hang_;
  std::string needs_restart_;  // keys, with commas
  TimePoint next_source_try_;
  TimePoint next_feed_;
  TimePoint next_checkpoint_;
  std::optional<TimePoint> last_checkpoint_;
  std::string checkpoint_error_;
  bool is_checkpoint_under_way_ = false;
  std::set<std::string> saves_under_way_;  // paths that somebody asked for
  bool is_device_recreated_ = false;       // in this procedure
  bool is_given_up_ = false;
  int exit_code_ = 0;

  std::mutex saved_mutex_;
  std::vector<SaveDone> saved_;
};

}  // namespace haustra
