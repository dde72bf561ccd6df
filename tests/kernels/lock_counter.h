// Counts the mutexes that the calling thread takes. Link lock_counter.cc into one test binary.
#pragma once

#include <cstdint>

namespace haustra::testing {

std::uint64_t NumLocksOfThisThread();

}  // namespace haustra::testing
