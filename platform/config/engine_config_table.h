// The keys of the engine's configuration: engine/config.h bound to "section.name". The schema of config/*.yaml.
#pragma once

#include <string>
#include <vector>

#include "engine/config.h"
#include "hal/core/status.h"
#include "platform/config/config_table.h"

namespace haustra {

std::vector<ConfigField> EngineConfigFields();

// What single values cannot say: kFailedPrecondition when two of them contradict each other.
Status CheckEngineConfig(const EngineConfig& config);

// Defaults, then the memory profile that file or command line name (memory_profiles.h), then the file (none when `path`
// is empty), then the assignments "key=value" of the command line in their order, then CheckEngineConfig. Errors: as
// ConfigStore's.
Result<ConfigStore<EngineConfig>> LoadEngineConfig(const std::string& path,
                                                   const std::vector<std::string>& assignments);

}  // namespace haustra
