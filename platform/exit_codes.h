// Exit codes of every program of the project (sysexits).
#pragma once

#include "hal/core/status.h"

namespace haustra {

enum ExitCode : int {
  kExitOk = 0,
  kExitUsage = 64,
  kExitBadData = 65,
  kExitNoInput = 66,
  kExitUnavailable = 69,
  kExitInternal = 70,
  kExitSystem = 71,
  kExitIo = 74,
  kExitBusy = 75,
  kExitConfig = 78,
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
    case StatusCode::kDeadlineExceeded:
    case StatusCode::kCancelled:
    case StatusCode::kInternal: return kExitInternal;
  }
  return kExitInternal;
}

}  // namespace haustra
