// The command line of haustra: all subcommands. Each lives in a folder of its own.
#pragma once

namespace haustra {

// Returns the exit code (tools/exit_codes.h).
int RunCommandLine(int argc, char** argv);

}  // namespace haustra
