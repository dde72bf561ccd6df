// The keys of the engine's configuration: engine/config.h bound to "section.name". The schema of config/*.yaml.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "engine/config.h"
#include "hal/core/status.h"
#include "platform/config/config_table.h"
#include "platform/config/memory_profiles.h"

namespace haustra {

std::vector<ConfigField> EngineConfigFields();

// What single values cannot say: kFailedPrecondition when two of them contradict each other.
Status CheckEngineConfig(const EngineConfig& config);

// The one way to a configuration that holds the engine's. Defaults, then the memory profile that file or command line
// name (memory_profiles.h), then the file (none when `path` is empty), then the assignments "key=value" of the command
// line in their order, then CheckEngineConfig. `engine_of`: a member or function that gives the EngineConfig. Errors:
// as ConfigStore's.
template <typename Config, typename EngineOf>
Result<ConfigStore<Config>> LoadConfig(const std::vector<ConfigField>& fields, EngineOf engine_of,
                                       const std::string& path, const std::vector<std::string>& assignments) {
  const auto apply_all = [&](ConfigStore<Config>* store) -> Status {
    if (!path.empty()) HAUSTRA_TRY(store->ApplyFile(path));
    for (const std::string& assignment : assignments) HAUSTRA_TRY(store->ApplyAssignment(assignment));
    return Status::Ok();
  };
  ConfigStore<Config> given(fields);
  HAUSTRA_TRY(apply_all(&given));
  // The profile comes first, wherever it is named, so that single keys override it.
  ConfigStore<Config> store(fields);
  const std::string& profile = std::invoke(engine_of, given.config()).memory.profile;
  if (given.origin("memory.profile").kind != ConfigOrigin::Kind::kDefault) {
    HAUSTRA_TRY(store.ApplyText(MemoryProfileText(profile), "memory profile " + profile));
  }
  HAUSTRA_TRY(apply_all(&store));
  HAUSTRA_TRY(CheckEngineConfig(std::invoke(engine_of, store.config())));
  return store;
}

// Of the engine alone.
Result<ConfigStore<EngineConfig>> LoadEngineConfig(const std::string& path,
                                                   const std::vector<std::string>& assignments);

}  // namespace haustra
