// Looks for words in the memory of the GPU that nobody holds: what a process that is given it could read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "hal/core/status.h"

namespace haustra::testing {

inline constexpr std::size_t kMaxSearchedWords = 64;

struct FreeMemorySearch {
  std::uint64_t num_searched_bytes = 0;
  std::uint64_t num_found = 0;  // places, at multiples of four bytes, where one of the words stands
};

// Takes all memory that the current device has left, searches it and gives it back. At most kMaxSearchedWords. Nobody
// else should use the device meanwhile.
Result<FreeMemorySearch> SearchFreeDeviceMemory(std::span<const std::uint64_t> words);

// Takes memory, fills it with the words and gives it back as it is.
Status LeaveInDeviceMemory(std::span<const std::uint64_t> words);

}  // namespace haustra::testing
