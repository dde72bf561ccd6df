// Exit codes of every program of the project (sysexits).
#pragma once

#include "hal/core/status.h"

namespace haustra {

enum ExitCode : int {
  kExitOk = 0,
  kExitNotMet = 1,
  kExitUsage = 64,
  kExitBadData = 65,
  kExitNoInput = 66,
  kExitUnavailable = 69,
  kExitInternal = 70,
  kExitSystem = 71,
  kExitInTheWay = 73,
  kExitIo = 74,
  kExitBusy = 75,
  kExitConfig = 78,
  kExitStopped = 130,
};

struct ExitCodeMeaning {
  ExitCode code;
  const char* meaning;
};

// As help and manual pages show them.
inline constexpr ExitCodeMeaning kExitCodeMeanings[] = {
    {kExitOk, "done"},
    {kExitNotMet, "measured, and not good enough; refused by the service"},
    {kExitUsage, "wrong arguments"},
    {kExitBadData, "a file or a frame is not what it should be"},
    {kExitNoInput, "a file or folder to read is not there, other than a configuration"},
    {kExitUnavailable, "a device, a service or a file to read cannot be reached, or memory is short now"},
    {kExitInternal, "internal error"},
    {kExitSystem, "the operating system refuses something"},
    {kExitInTheWay, "something is where the output should go"},
    {kExitIo, "the output cannot be written"},
    {kExitBusy, "somebody else uses it"},
    {kExitConfig, "a configuration is wrong or not there, or an input does not meet what is asked of it"},
    {kExitStopped,
     "stopped (Ctrl-C, SIGTERM, SIGHUP) before it was done; run and capture write what they have, and end with 0"},
};

inline int ExitCodeFor(StatusCode code) {
  switch (code) {
    case StatusCode::kOk: return kExitOk;
    case StatusCode::kInvalidArgument: return kExitBadData;
    case StatusCode::kNotFound: return kExitNoInput;
    case StatusCode::kDataLoss: return kExitBadData;
    case StatusCode::kUnavailable: return kExitUnavailable;
    case StatusCode::kFailedPrecondition: return kExitConfig;
    case StatusCode::kCapacityExceeded: return kExitConfig;
    case StatusCode::kCancelled: return kExitStopped;
    case StatusCode::kDeadlineExceeded:
    case StatusCode::kInternal: return kExitInternal;
  }
  return kExitInternal;
}

}  // namespace haustra
