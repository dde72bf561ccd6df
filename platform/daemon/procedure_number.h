// Numbers of procedures, each given once: no other procedure has the same, after a restart of the service or of the
// system neither. So an order that names its procedure is never carried out in another one, however long it waited.
//
//   RUN * 10000 + COUNT   RUN is drawn by lot when the service starts, COUNT counts its procedures from 1
//
// reentrant.
#pragma once

#include <cstdint>

#include "hal/core/status.h"

namespace haustra {

// After so many the numbers go on in those of the next run, which no service will have drawn either.
inline constexpr std::uint64_t kProceduresPerRun = 10'000;
// Two runs agree once in so many pairs. Numbers stay below 2^53: a browser holds them without loss.
inline constexpr std::uint64_t kNumRuns = std::uint64_t{1} << 39;

// 1 .. kNumRuns. kUnavailable: the system gives no random bytes.
Result<std::uint64_t> DrawRun();

// 0: no procedure.
constexpr std::uint64_t ProcedureNumber(std::uint64_t run, std::uint64_t count) {
  return count == 0 ? 0 : run * kProceduresPerRun + count;
}

static_assert(ProcedureNumber(kNumRuns, kProceduresPerRun) < std::uint64_t{1} << 53);

}  // namespace haustra
