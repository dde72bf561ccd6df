// The command line of haustra: all subcommands. Each lives in a folder of its own.
#pragma once

#include <CLI/App.hpp>
#include <functional>

namespace haustra {

// All subcommands with their options; `action` is what the chosen one does. What help, manual pages and completions are
// made from.
void AddCommands(CLI::App& app, std::function<int()>& action);

// Returns the exit code (tools/exit_codes.h): kExitIo also when what was printed is lost (console.h).
int RunCommandLine(int argc, char** argv);

}  // namespace haustra
