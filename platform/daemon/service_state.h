// What haustrad does about what happens, as a table: no input and no output here, so that every case can be tested.
//
// One worker at a time does the work of one procedure, and is thrown away with it. The worker of the next one is
// started at once, so that it stands ready when it is told to begin.
//
//   down      nothing yet
//   starting  a worker opens the source and makes its engine
//   waiting   ... and there is no camera; it is looked for every second
//   ready     the worker has an empty engine; nothing is looked at
//   loading   it reads the maps of the procedure that goes on
//   recording the disk is told that a procedure is open
//   beginning the worker is told to begin
//   running   a procedure
//   stopping  the threads of the worker end
//   keeping   maps are written
//   stopped   they were to be kept, and that failed: `end` again, or `end wipe`
//   reaping   the worker was killed; the kernel takes back its memory
//   wiping    files and published records of the procedure
//   closing   the disk is told once more that the service was stopped in order, should the first time have failed
//   over      the service ends
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace haustra {

enum class ServicePhase : std::uint8_t {
  kDown,
  kStarting,
  kWaiting,
  kReady,
  kLoading,
  kRecording,
  kBeginning,
  kRunning,
  kStopping,
  kKeeping,
  kStopped,
  kReaping,
  kWiping,
  kClosing,
  kOver,
};
inline constexpr int kNumServicePhases = 15;

// Interrupted: one of an earlier service lies on the disk, or one that could not be wiped, and somebody has to say what
// becomes of it.
enum class ProcedurePhase : std::uint8_t { kNone, kOpen, kInterrupted };

// What is under way.
enum class ServicePurpose : std::uint8_t {
  kNone,
  kBegin,
  kResume,
  kGoOn,  // a worker failed, and the next one goes on from the last checkpoint
  kEndKeep,
  kEndWipe,
  kTerminate,
  kFail,  // the service ends with exit_code
};

enum class ServiceEventKind : std::uint8_t {
  kStart,
  kWorkerWaits,  // for a camera
  kWorkerReady,
  kWorkerFails,  // it cannot make itself ready; code: why, as an exit code
  kLoaded,
  kNotLoaded,
  kRecorded,  // or not: a full disk costs what a crash would lose, not the procedure
  kBegun,
  kStoppedWithMaps,  // the worker's threads have ended, and its maps can be read
  kStoppedWithoutMaps,
  kKept,
  kNotKept,
  kWiped,
  kNotWiped,     // something of the procedure may still lie there
  kFault,        // the worker is of no further use: lost device, hang, nonsense
  kSessionEnds,  // by itself, the maps can be read; code: why
  kWorkerGone,   // and reaped
  kTimeUp,       // the limit of the phase
  kBegin,
  kResume,
  kEndKeep,
  kEndWipe,
  kTerminate,
};
inline constexpr int kNumServiceEvents = 23;

struct ServiceEvent {
  ServiceEventKind kind = ServiceEventKind::kStart;
  int code = 0;  // kWorkerFails, kSessionEnds
};

enum class ServiceAction : std::uint8_t {
  kStartWorker,
  kLoad,  // the last checkpoint; that there is none counts as loaded
  kRecordOpen,
  kBeginWorker,
  kStopWorker,
  kKeepMaps,        // of the worker, under the procedure's label
  kKeepCheckpoint,  // the same, from the disk
  kSaveCheckpoint,
  kKillWorker,
  kWipe,
  kRecordStopped,  // the disk is told that the service is stopped in order
  kSayDone,        // to whoever asked
  kSayFailed,
  kLeave,
};

struct ServiceState {
  ServicePhase phase = ServicePhase::kDown;
  ProcedurePhase procedure = ProcedurePhase::kNone;
  ServicePurpose purpose = ServicePurpose::kNone;
  bool owes_answer = false;  // somebody asked for what is under way
  bool has_worker = false;   // a process that is not reaped
  bool has_maps = false;     // the worker's, which can be read
  bool is_kept = false;      // what was to be kept of this procedure
  bool has_gone_on = false;  // a worker was replaced since the last begin: another one is not
  int exit_code = 0;

  bool operator==(const ServiceState&) const = default;
};

struct ServiceStep {
  ServiceState state;
  std::vector<ServiceAction> actions;  // in this order

  bool operator==(const ServiceStep&) const = default;
};

// reentrant. An event that means nothing in a state changes nothing.
ServiceStep Next(const ServiceState& state, const ServiceEvent& event);

// Whether a request is dealt with now; else it waits its turn.
constexpr bool TakesRequests(ServicePhase phase) {
  return phase == ServicePhase::kWaiting || phase == ServicePhase::kReady || phase == ServicePhase::kRunning ||
         phase == ServicePhase::kStopped;
}
// Likewise for the end of the service. The disk is told at once in any case.
constexpr bool TakesTerminate(ServicePhase phase) { return TakesRequests(phase) || phase == ServicePhase::kStarting; }

std::string_view ToString(ServicePhase phase);
std::string_view ToString(ServiceEventKind event);
std::string_view ToString(ServiceAction action);

}  // namespace haustra
