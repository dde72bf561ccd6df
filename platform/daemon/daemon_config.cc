#include "platform/daemon/daemon_config.h"

#include <cstddef>
#include <cstdlib>
#include <type_traits>
#include <utility>

#include "platform/assemble.h"
#include "platform/config/engine_config_table.h"

namespace haustra {
namespace {

static_assert(std::is_standard_layout_v<DaemonConfig>, "a pointer to it is one to its first member");

std::string FolderOf(const char* variable) {
  const char* value = std::getenv(variable);
  // systemd gives a list when the unit names several.
  return value == nullptr ? std::string() : std::string(value).substr(0, std::string(value).find(':'));
}

constexpr ConfigReload kLive = ConfigReload::kLive;
constexpr ConfigReload kRestart = ConfigReload::kRestart;

}  // namespace

std::vector<ConfigField> DaemonConfigFields() {
  using C = DaemonConfig;
  std::vector<ConfigField> fields = EngineConfigFields();
  const auto add = [&fields](ConfigField field) { fields.push_back(std::move(field)); };

  add(BindText<&C::source, &SourceConfig::path>("source.path", "camera, folder of frames, data set or video",
                                                kRestart));
  add(BindText<&C::source, &SourceConfig::calibration>("source.calibration",
                                                       "camera calibration; empty: what the source carries", kRestart));
  add(BindText<&C::source, &SourceConfig::mask>(
      "source.mask", "static mask, 255 inside the scope's window; empty: what the source carries", kRestart));
  add(BindField<&C::source, &SourceConfig::every_nth>("source.every_nth", {1, 1000}, "frames",
                                                      "only every n-th frame is used", kRestart));
  add(BindField<&C::source, &SourceConfig::halve>("source.halve", {}, "", "2x2 pixels are averaged", kRestart));
  add(BindChoice<&C::source, &SourceConfig::deinterlace>(
      "source.deinterlace", {"auto", "off", "on"},
      "one field of pictures that two were woven into; auto: where it shows", kRestart));
  add(BindField<&C::source, &SourceConfig::rate>("source.rate", {0.01, 100}, "",
                                                 "pace of a recording relative to its camera's", kRestart));

  add(BindChoice<&C::vision, &VisionConfig::device>(
      "vision.device", {"auto", "cpu", "cuda"},
      "what extracts and matches; auto: cuda where this build and this machine have it, else cpu", kRestart));
  add(BindField<&C::vision, &VisionConfig::threads>(
      "vision.threads", {0, static_cast<double>(MaxVisionThreads())}, "threads",
      "of the CPU device; 0: one a core, one less with rt.enabled", kRestart));
  add(BindField<&C::vision, &VisionConfig::answer_limit_ms>("vision.answer_limit_ms", {50, 600000}, "ms",
                                                            "without an answer: the vision device hangs", kRestart));

  add(BindField<&C::procedure, &ProcedureConfig::begin_at_start>(
      "procedure.begin_at_start", {}, "", "a procedure begins with the service, not when the tower says so", kRestart));
  add(BindField<&C::procedure, &ProcedureConfig::keep_data>("procedure.keep_data", {}, "",
                                                            "the maps of a procedure are kept when it ends", kLive));
  add(BindField<&C::procedure, &ProcedureConfig::resume_limit_s>(
      "procedure.resume_limit_s", {0, 86400}, "s",
      "age of the last checkpoint up to which an interrupted procedure goes on by itself", kRestart));

  add(BindField<&C::checkpoint, &CheckpointConfig::interval_s>("checkpoint.interval_s", {0, 3600}, "s",
                                                               "between two checkpoints; 0: only at the stop", kLive));

  add(BindField<&C::publish, &PublishConfig::snapshot_interval_ms>("publish.snapshot_interval_ms", {50, 60000}, "ms",
                                                                   "between two snapshots of the map", kLive));
  add(BindField<&C::publish, &PublishConfig::view>(
      "publish.view", {}, "",
      "small pictures and matched points for haustra view, in the file \"view\" beside the poses", kRestart));
  add(BindField<&C::publish, &PublishConfig::depth>(
      "publish.depth", {}, "",
      "keyframes with their depth for haustra view, in the file \"depth\" beside the poses; needs depth.enabled",
      kRestart));
  add(BindText<&C::publish, &PublishConfig::group>(
      "publish.group", "system group that may read poses and ask for status and metrics; empty: the service's own",
      kRestart));
  add(BindText<&C::control, &ControlConfig::group>(
      "control.group", "system group that may begin and end procedures; empty: publish.group", kRestart));

  add(BindField<&C::watchdog, &WatchdogConfig::tracking_limit_ms>(
      "watchdog.tracking_limit_ms", {100, 600000}, "ms", "without a sign of life: the tracking thread hangs", kLive));
  add(BindField<&C::watchdog, &WatchdogConfig::capture_limit_ms>(
      "watchdog.capture_limit_ms", {100, 600000}, "ms", "without a sign of life: the capture thread hangs", kLive));
  add(BindField<&C::watchdog, &WatchdogConfig::mapping_limit_ms>("watchdog.mapping_limit_ms", {1000, 600000}, "ms",
                                                                 "in one step: the mapping or the merging thread hangs",
                                                                 kLive));
  add(BindField<&C::watchdog, &WatchdogConfig::worker_limit_ms>(
      "watchdog.worker_limit_ms", {100, 600000}, "ms", "without a sign of life: the worker is replaced", kLive));
  add(BindField<&C::watchdog, &WatchdogConfig::stop_limit_ms>("watchdog.stop_limit_ms", {100, 600000}, "ms",
                                                              "until a worker that does not end is killed", kLive));
  add(BindField<&C::watchdog, &WatchdogConfig::work_limit_ms>("watchdog.work_limit_ms", {1000, 600000}, "ms",
                                                              "of one job of the worker or the disk", kLive));

  add(BindText<&C::files, &FilesConfig::state_folder>(
      "files.state_folder", "for checkpoints and saved maps; empty: $STATE_DIRECTORY", kRestart));
  add(BindText<&C::files, &FilesConfig::runtime_folder>(
      "files.runtime_folder", "for poses and the control socket; empty: $RUNTIME_DIRECTORY", kRestart));

  add(BindChoice<&C::log, &LogConfig::level>("log.level", {"error", "warning", "info", "debug"},
                                             "least important record that is written", kLive));
  return fields;
}

Result<ConfigStore<DaemonConfig>> LoadDaemonConfig(const std::string& path,
                                                   const std::vector<std::string>& assignments) {
  HAUSTRA_ASSIGN(ConfigStore<DaemonConfig> store,
                 LoadConfig<DaemonConfig>(DaemonConfigFields(), &DaemonConfig::engine, path, assignments));
  if (store.config().publish.depth && !store.config().engine.depth.enabled) {
    return InvalidArgument("publish.depth is true, and depth.enabled is not: there is no depth to publish");
  }
  return store;
}

void FillFolders(FilesConfig* files) {
  if (files->state_folder.empty()) files->state_folder = FolderOf("STATE_DIRECTORY");
  if (files->runtime_folder.empty()) files->runtime_folder = FolderOf("RUNTIME_DIRECTORY");
}

std::string PrintDaemonConfig(const DaemonConfig& config) {
  const ConfigTable table(DaemonConfigFields());
  return table.Print(&config, std::vector<ConfigOrigin>(table.fields().size()));
}

ConfigChange ApplyLive(const DaemonConfig& running, const DaemonConfig& loaded) {
  ConfigChange change{running, {}, {}};
  for (const ConfigField& field : DaemonConfigFields()) {
    const ConfigValue value = field.read(&loaded);
    if (value == field.read(&running)) continue;
    if (field.reload == ConfigReload::kLive) {
      field.write(&change.config, value);
      change.applied.push_back(field.key);
    } else {
      change.needs_restart.push_back(field.key);
    }
  }
  return change;
}

}  // namespace haustra
