// Exit codes of every program of the project (sysexits).
#pragma once

#include <string>

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
  const char* of_haustra;   // as help and manual pages show it
  const char* of_haustrad;  // nullptr: never
};

inline constexpr ExitCodeMeaning kExitCodeMeanings[] = {
    {kExitOk, "done", "stopped as told"},
    {kExitNotMet, "measured, and not good enough; refused by the service", nullptr},
    {kExitUsage, "wrong arguments", "wrong arguments"},
    {kExitBadData, "a file or a frame is not what it should be", "source or calibration is not what it should be"},
    {kExitNoInput, "a file or folder to read is not there, other than a configuration",
     "source or calibration is not there"},
    {kExitUnavailable, "a device, a service or a file to read cannot be reached, or memory is short now",
     "device or GPU not available, lost or hanging; a file cannot be reached; memory is short now"},
    {kExitInternal, "internal error", "internal error"},
    {kExitSystem, "the operating system refuses something", "the system refuses what it always gives"},
    {kExitInTheWay, "something is where the output should go", nullptr},
    {kExitIo, "the output cannot be written", "files cannot be written"},
    {kExitBusy, "somebody else uses it", "another haustrad uses the state folder"},
    {kExitConfig, "a configuration is wrong or not there, or an input does not meet what is asked of it",
     "a configuration that is wrong or not there, or whose memory plan is above a limit that was set"},
    {kExitStopped,
     "stopped (Ctrl-C, SIGTERM, SIGHUP) before it was done; run and capture write what they have, and end with 0",
     nullptr},
};

// "Exit codes:" and a line for each, without a line end at the end.
inline std::string ExitCodesText(const char* ExitCodeMeaning::*of_program) {
  std::string text = "Exit codes:";
  for (const ExitCodeMeaning& code : kExitCodeMeanings) {
    if (code.*of_program == nullptr) continue;
    text += "\n  " + std::to_string(code.code) + std::string(code.code < 10 ? 2 : 1, ' ') + code.*of_program;
  }
  return text;
}

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
