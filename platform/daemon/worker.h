// The worker of one procedure: `haustrad --worker FD`. It owns engine, vision device, source and the threads in real
// time, and does what the supervisor (daemon.h) says over a channel (worker_channel.h). It knows no path of the
// service: files come open.
//
// It has no way to end a procedure but its own end. The supervisor kills it, and the kernel and the driver take back
// and clear its memory, the locked and the device's, too.
//
// Threads: the one that calls RunWorker (the channel; signs of life, 20 times a second, whatever else hangs), one on
// which the engine is made, told to begin and to stop, and the session's.
#pragma once

#include <functional>
#include <memory>

#include "hal/frame_source.h"
#include "platform/daemon/daemon_config.h"
#include "platform/daemon/procedure.h"

namespace haustra {

// What a test puts something else in the place of.
struct WorkerParts {
  std::function<Result<std::unique_ptr<FrameSource>>(const SourceConfig&)> open_source;
  MakeVisionDevice make_device;
};
// Those that the configuration names.
WorkerParts SystemWorkerParts();

// The number of the descriptor at which a worker finds its channel.
inline constexpr int kWorkerChannel = 3;
// What follows the program's name.
inline constexpr const char* kWorkerOption = "--worker";

// Before anything else in the process of a worker: it ends with its parent, and nobody dumps it. False: the system
// refuses.
[[nodiscard]] bool BecomeWorker();

// Until the channel ends; then the process is to end at once, without destructors (std::_Exit), with this code.
int RunWorker(int channel, const WorkerParts& parts);

}  // namespace haustra
