// What Ctrl-C, SIGTERM and a terminal that is closed (SIGHUP) do to a command, and a reader of its output that goes
// away (SIGPIPE). One model for all commands: a stop ends a command at once while nothing is written, and is a flag to
// it from its first output on.
#pragma once

#include <atomic>

namespace haustra {

// For the start of the program. From now on a stop says "haustra COMMAND: stopped" and ends with kExitStopped, and a
// closed pipe is an error of writing. A SIGHUP that was ignored at the start, as under nohup, still is.
void HandleSignals(const char* command);

// From now on a stop only sets the flag, which stands for the whole process: the command ends in good order.
const std::atomic<bool>& CatchStopSignals();
// Set by one that comes when the flag is set: of who does not want to wait for the rest.
const std::atomic<bool>& SecondStopSignal();

}  // namespace haustra
