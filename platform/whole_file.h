// The bytes of a file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

// kNotFound: no such file; kUnavailable: cannot be read, or is none. Messages name it.
Result<std::vector<std::uint8_t>> ReadWholeFile(const std::string& path);

}  // namespace haustra
