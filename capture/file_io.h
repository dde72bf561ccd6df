// Whole files in and out, with messages that name the file. reentrant.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/status.h"

namespace haustra::capture::internal {

// Replaces `bytes` (its memory is reused). kNotFound: no such file; kUnavailable: cannot be read (a folder, rights,
// I/O); kCapacityExceeded: longer than max_bytes.
Status ReadFile(const std::string& path, std::size_t max_bytes, std::vector<std::uint8_t>* bytes);
Result<std::string> ReadTextFile(const std::string& path, std::size_t max_bytes);

// kUnavailable: cannot be created or not written to the end (disk full, rights).
Status WriteFile(const std::string& path, std::span<const std::uint8_t> bytes);
Status WriteTextFile(const std::string& path, std::string_view text);

}  // namespace haustra::capture::internal
