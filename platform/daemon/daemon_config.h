// The configuration of haustrad: that of the engine, and what a service needs beside it. One file holds both.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/config.h"
#include "hal/core/status.h"
#include "platform/config/config_table.h"

namespace haustra {

struct SourceConfig {
  std::string path;         // camera, folder of frames, data set or video
  std::string calibration;  // empty: what the source carries
  std::string mask;         // 255 inside the scope's window; empty: what the source carries
  int every_nth = 1;        // [1, 1000]
  bool halve = false;
  std::string deinterlace = "auto";
  double rate = 1.0;  // pace of a recording relative to its camera's [0.01, 100]
};

struct VisionConfig {
  std::string device = "cpu";  // auto, cpu or cuda: each worker looks anew what auto is
  int threads = 0;             // of the CPU device; 0: NumVisionThreads (assemble.h) decides [0, 256]
  // A device that owes an answer for so long hangs. An answer takes tens of milliseconds; the limit is below that of
  // the tracking thread, so that the device is named and not the thread that waits for it [50, 600000]
  int answer_limit_ms = 500;
};

struct ProcedureConfig {
  // Off: the tower says begin, so that nothing is looked at before somebody meant it to be.
  bool begin_at_start = false;
  bool keep_data = false;  // of a procedure that has ended
  // After a crash the procedure goes on by itself if its last checkpoint is no older. Later, or after a restart of the
  // machine, or when the service was stopped in order, another patient may lie there: then somebody must say `resume`
  // or `end` [0, 86400]
  int resume_limit_s = 600;
};

struct CheckpointConfig {
  int interval_s = 30;  // what a power cut may cost; 0: none but at the stop [0, 3600]
};

struct PublishConfig {
  int snapshot_interval_ms = 500;  // [50, 60000]
  std::string group;               // may read poses and ask for status and metrics; empty: the service's own
  // Small pictures and matched points for `haustra view`. Off: pictures of a patient leave the worker only where
  // somebody wants to look at them.
  bool view = false;
  // Keyframes with their depth, in colour, for `haustra view` and others that make the surface of the wall. Needs
  // depth.enabled; off as `view` is.
  bool depth = false;
};

struct ControlConfig {
  std::string group;  // may begin and end procedures; empty: publish.group
};

struct WatchdogConfig {
  // A thread that has not been heard of for so long hangs. One frame takes tracking 40 ms at most, a step takes mapping
  // a second at most; the margin is for a machine in trouble, which a restart does not mend.
  int tracking_limit_ms = 1000;  // [100, 600000]
  int capture_limit_ms = 3000;   // [100, 600000]
  int mapping_limit_ms = 30000;  // [1000, 600000]
  // The worker as a whole, which says many times a second that it is there [100, 600000]
  int worker_limit_ms = 5000;
  // A worker whose threads have not ended by then is killed. Below TimeoutStopSec of the unit.
  int stop_limit_ms = 4000;  // [100, 600000]
  // Making an engine, loading maps, keeping them: what a worker may take for it. So may each call of a camera's driver
  // to bring the camera back. A job of the disk: the watchdog is fed meanwhile, up to this. A CUDA context and a full
  // atlas take seconds; a disk that hangs takes for ever.
  int work_limit_ms = 30000;  // [1000, 600000]
};

struct FilesConfig {
  std::string state_folder;    // empty: $STATE_DIRECTORY, which systemd sets
  std::string runtime_folder;  // empty: $RUNTIME_DIRECTORY
};

struct LogConfig {
  std::string level = "info";
};

// The engine comes first: its table is bound to EngineConfig, and a pointer to this is a pointer to that.
struct DaemonConfig {
  EngineConfig engine;
  SourceConfig source;
  VisionConfig vision;
  ProcedureConfig procedure;
  CheckpointConfig checkpoint;
  PublishConfig publish;
  ControlConfig control;
  WatchdogConfig watchdog;
  FilesConfig files;
  LogConfig log;
};

std::vector<ConfigField> DaemonConfigFields();

// As LoadConfig (engine_config_table.h), then the checks between the service's own values. Touches no device and no
// file but `path`. Errors: as ConfigStore's.
Result<ConfigStore<DaemonConfig>> LoadDaemonConfig(const std::string& path,
                                                   const std::vector<std::string>& assignments);

// Folders that the configuration leaves open are those of the service manager, from the environment.
void FillFolders(FilesConfig* files);

// Every key with its value, as a file that gives the same configuration.
std::string PrintDaemonConfig(const DaemonConfig& config);

// What a reload does.
struct ConfigChange {
  DaemonConfig config;                     // the old one with the live keys of the new one
  std::vector<std::string> applied;        // live keys that changed
  std::vector<std::string> needs_restart;  // other keys that changed, which stay as they were
};
ConfigChange ApplyLive(const DaemonConfig& running, const DaemonConfig& loaded);

}  // namespace haustra
