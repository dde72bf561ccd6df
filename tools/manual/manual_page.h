// Manual pages from what the programs themselves go by: their options, and the table of configuration keys.
// reentrant.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "platform/config/config_field.h"

namespace haustra::manual {

// What stands in the page of an option beside its description.
struct OptionText {
  std::string names;        // "-h, --help", or the name of a positional
  std::string value;        // what follows it: "auto|cpu|cuda", "TEXT"; empty: nothing
  std::string description;  // with range and default
  std::vector<std::string> choices;
  bool is_positional = false;
  bool takes_many = false;
  bool is_path = false;  // of the type TEXT, and nothing to choose from
};
std::vector<OptionText> OptionsOf(const CLI::App& command);

// The commands of a program, or those below a command.
std::vector<const CLI::App*> CommandsOf(const CLI::App& app);

// One name of a program or a command: words joined by `joint`, "haustra-run".
std::string NameOf(const CLI::App& command, char joint);

// Page of a program or of one of its commands, in section 1 or 8. `see_also`: pages like "haustrad(8)".
std::string CommandPage(const CLI::App& command, int section, const std::string& version,
                        const std::vector<std::string>& see_also);

// haustra.yaml(5). `defaults` points to the struct that the table is bound to. The keys of `engine_fields` are those
// that `haustra` reads, too; the others are the service's alone.
std::string ConfigurationPage(const std::vector<ConfigField>& fields, const void* defaults,
                              const std::vector<ConfigField>& engine_fields, const std::string& version);

}  // namespace haustra::manual
