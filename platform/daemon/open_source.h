// The frame source that the configuration names.
#pragma once

#include <memory>

#include "hal/frame_source.h"
#include "platform/daemon/daemon_config.h"

namespace haustra {

// Whether it is a camera, which may be plugged in later; anything else must be there.
bool IsCamera(const SourceConfig& config);

// Errors of OpenSequence.
Result<std::unique_ptr<FrameSource>> OpenSource(const SourceConfig& config);

}  // namespace haustra
