#include <string_view>

#include "platform/config/engine_config_table.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {

void FuzzConfig(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  ConfigStore<EngineConfig> store(EngineConfigFields());
  const std::string defaults = store.Print();
  const Status status = store.ApplyText(text, "fuzz.yaml");
  if (!status.ok()) {
    HAUSTRA_CHECK(!status.message().empty());
    HAUSTRA_CHECK(store.Print() == defaults);
  } else {
    (void)CheckEngineConfig(store.config());
    // What is printed gives the same configuration.
    ConfigStore<EngineConfig> again(EngineConfigFields());
    HAUSTRA_CHECK(again.ApplyText(store.Print(), "printed.yaml").ok());
    ConfigStore<EngineConfig> and_again(EngineConfigFields());
    HAUSTRA_CHECK(and_again.ApplyText(again.Print(), "printed.yaml").ok());
    HAUSTRA_CHECK(again.Print() == and_again.Print());
  }
  ConfigStore<EngineConfig> assigned(EngineConfigFields());
  if (!assigned.ApplyAssignment(text).ok()) HAUSTRA_CHECK(assigned.Print() == defaults);
}

}  // namespace haustra::test
