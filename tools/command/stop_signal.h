// SIGINT and SIGTERM as a flag, for commands that then end in good order.
#pragma once

#include <atomic>

namespace haustra {

// From now on both set the flag, which stands for the whole process.
const std::atomic<bool>& CatchStopSignals();
// Set by one that comes when the flag is set: of who does not want to wait for the rest.
const std::atomic<bool>& SecondStopSignal();

}  // namespace haustra
