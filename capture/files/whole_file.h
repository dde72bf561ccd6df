// A file as a whole in memory. Whatever reads one reads it here. reentrant.
//
// Errors: kNotFound: no such file; kDataLoss: a folder; kUnavailable: cannot be opened or read; kCapacityExceeded:
// longer than max_bytes, of which nothing more is read. The message names the file and the reason.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "hal/core/status.h"

namespace haustra {

// For what has no bound of its own: what is longer would fill the memory.
inline constexpr std::size_t kMaxFileBytes = std::size_t{4} << 30;

// Replaces `bytes`, whose memory is used again; empty after an error.
Status ReadWholeFile(const std::string& path, std::size_t max_bytes, std::vector<std::uint8_t>* bytes);
Result<std::vector<std::uint8_t>> ReadWholeFile(const std::string& path, std::size_t max_bytes = kMaxFileBytes);
Result<std::string> ReadWholeText(const std::string& path, std::size_t max_bytes = kMaxFileBytes);

}  // namespace haustra
