// Writes the manual pages and the completions of the shells, as `share/` of an installation has them:
//
//     haustra_manual FOLDER
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "platform/config/engine_config_table.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/daemon_options.h"
#include "platform/version.h"
#include "tools/command/command_line.h"
#include "tools/command/output_folder.h"
#include "tools/exit_codes.h"
#include "tools/manual/completion.h"
#include "tools/manual/manual_page.h"

namespace haustra {
namespace {

namespace fs = std::filesystem;

Status Write(const fs::path& path, const std::string& text) {
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  return WriteFile(path.string(), text);
}

Status WriteCompletions(const fs::path& folder, const CLI::App& app, const std::vector<ConfigField>& fields) {
  const std::string name = app.get_name();
  std::vector<std::string> keys;
  for (const ConfigField& field : fields) keys.push_back(field.key);
  HAUSTRA_TRY(Write(folder / "bash-completion/completions" / name, manual::BashCompletion(app, keys)));
  return Write(folder / "zsh/site-functions" / ("_" + name), manual::ZshCompletion(app, keys));
}

Status WriteAll(const fs::path& folder) {
  CLI::App app("Monocular visual SLAM for endoscopy", "haustra");
  app.set_version_flag("--version", Version());
  std::function<int()> action;
  AddCommands(app, action);
  const std::string version = std::string("haustra ") + Version();
  std::vector<std::string> pages;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    const std::string name = manual::NameOf(*command, '-');
    pages.push_back(name + "(1)");
    HAUSTRA_TRY(Write(folder / "man/man1" / (name + ".1"),
                      manual::CommandPage(*command, 1, version, {"haustra(1)", "haustra.yaml(5)"})));
  }
  pages.insert(pages.end(), {"haustra.yaml(5)", "haustrad(8)"});
  HAUSTRA_TRY(Write(folder / "man/man1/haustra.1", manual::CommandPage(app, 1, version, pages)));

  CLI::App daemon("", "haustrad");
  DaemonArguments arguments;
  AddDaemonOptions(daemon, arguments);
  HAUSTRA_TRY(Write(folder / "man/man8/haustrad.8",
                    manual::CommandPage(daemon, 8, version,
                                        {"haustra(1)", "haustra-control(1)", "haustra-watch(1)", "haustra.yaml(5)"})));

  const std::vector<ConfigField> daemon_fields = DaemonConfigFields();
  const DaemonConfig defaults;
  HAUSTRA_TRY(Write(folder / "man/man5/haustra.yaml.5",
                    manual::ConfigurationPage(daemon_fields, &defaults, EngineConfigFields(), version)));

  HAUSTRA_TRY(WriteCompletions(folder, app, EngineConfigFields()));
  return WriteCompletions(folder, daemon, daemon_fields);
}

}  // namespace
}  // namespace haustra

int main(int argc, char** argv) {
  using namespace haustra;
  if (argc != 2) {
    std::fprintf(stderr, "usage: haustra_manual FOLDER\n");
    return kExitUsage;
  }
  try {
    const Status status = WriteAll(argv[1]);
    if (status.ok()) return kExitOk;
    std::fprintf(stderr, "haustra_manual: %s\n", status.message().c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "haustra_manual: %s\n", error.what());
    return kExitInternal;
  }
  return kExitIo;
}
