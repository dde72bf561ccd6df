// A text file as a whole, for what people write: configurations and requirements.
#pragma once

#include <string>

#include "hal/core/status.h"

namespace haustra::config {

// kNotFound: no such file, or a folder; kUnavailable: cannot be read. The message names the file and the reason.
// reentrant.
Result<std::string> ReadTextFile(const std::string& path);

}  // namespace haustra::config
