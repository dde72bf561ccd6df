// JSON files. reentrant.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "hal/core/status.h"

namespace haustra::evaluate {

// Errors of ReadText; kInvalidArgument, with the file: not JSON, or no object.
Result<nlohmann::json> ReadJsonObject(const std::string& path);

}  // namespace haustra::evaluate
