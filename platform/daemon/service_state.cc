#include "platform/daemon/service_state.h"

#include <iterator>
#include <utility>

#include "platform/exit_codes.h"

namespace haustra {
namespace {

using Phase = ServicePhase;
using Purpose = ServicePurpose;
using Event = ServiceEventKind;
using Action = ServiceAction;

ServiceStep To(ServiceState state, Phase phase, std::vector<Action> actions = {}) {
  state.phase = phase;
  return {state, std::move(actions)};
}

// The answer that is owed, if any, goes in front.
ServiceStep Answered(ServiceStep step, Action answer) {
  if (step.state.owes_answer) step.actions.insert(step.actions.begin(), answer);
  step.state.owes_answer = false;
  return step;
}

ServiceStep Renewed(ServiceState state) {
  state.has_worker = true;
  return To(state, Phase::kStarting, {Action::kStartWorker});
}

ServiceStep Kill(const ServiceState& state) { return To(state, Phase::kReaping, {Action::kKillWorker}); }

bool IsEnd(Purpose purpose) { return purpose == Purpose::kEndKeep || purpose == Purpose::kEndWipe; }

// There is no worker any more: what follows depends on what it was for.
ServiceStep AfterWorker(ServiceState state) {
  state.has_worker = state.has_maps = false;
  switch (state.purpose) {
    case Purpose::kEndKeep:
      if (!state.is_kept) return To(state, Phase::kKeeping, {Action::kKeepCheckpoint});
      return To(state, Phase::kWiping, {Action::kWipe});
    case Purpose::kEndWipe: return To(state, Phase::kWiping, {Action::kWipe});
    case Purpose::kTerminate:
      if (state.procedure != ProcedurePhase::kNone) return To(state, Phase::kClosing, {Action::kRecordStopped});
      return To(state, Phase::kOver, {Action::kLeave});
    case Purpose::kFail: return Answered(To(state, Phase::kOver, {Action::kLeave}), Action::kSayFailed);
    case Purpose::kBegin:
    case Purpose::kResume:  // refused; else it would be kGoOn
      state.purpose = Purpose::kNone;
      return Answered(Renewed(state), Action::kSayFailed);
    case Purpose::kNone:
    case Purpose::kGoOn: return Renewed(state);
  }
  return {state, {}};
}

// The worker is of no further use, or gone.
ServiceStep WithoutWorker(ServiceState state, bool is_gone) {
  const bool had_maps = state.has_maps || state.phase == Phase::kRunning || state.phase == Phase::kStopping;
  state.has_maps = false;
  switch (state.purpose) {
    case Purpose::kTerminate:
      if (state.procedure == ProcedurePhase::kOpen && had_maps && state.exit_code == 0) {
        state.exit_code = kExitUnavailable;
      }
      break;
    case Purpose::kEndKeep:
    case Purpose::kEndWipe:
    case Purpose::kFail: break;
    case Purpose::kNone:
    case Purpose::kBegin:
    case Purpose::kResume:
    case Purpose::kGoOn:
      if (state.procedure != ProcedurePhase::kOpen && state.purpose == Purpose::kResume) break;
      state.purpose = state.procedure == ProcedurePhase::kOpen ? Purpose::kGoOn : Purpose::kNone;
      if (state.has_gone_on) {
        state.purpose = Purpose::kFail;
        state.exit_code = kExitUnavailable;
      }
      state.has_gone_on = true;
      break;
  }
  return is_gone ? AfterWorker(state) : Kill(state);
}

ServiceStep Keep(ServiceState state) {
  if (state.has_maps) return To(state, Phase::kKeeping, {Action::kKeepMaps});
  return state.has_worker ? Kill(state) : AfterWorker(state);
}

ServiceStep End(ServiceState state, Event event) {
  state.purpose = event == Event::kEndKeep ? Purpose::kEndKeep : Purpose::kEndWipe;
  state.owes_answer = true;
  if (state.phase == Phase::kRunning) return To(state, Phase::kStopping, {Action::kStopWorker});
  if (state.phase == Phase::kStopped && event == Event::kEndKeep) return Keep(state);
  return state.has_worker ? Kill(state) : AfterWorker(state);
}

ServiceStep Stop(ServiceState state) {
  // Of an end that has been done but for the next worker, or of a procedure that cannot go on now.
  const Action answer = IsEnd(state.purpose) ? Action::kSayDone : Action::kSayFailed;
  state.purpose = Purpose::kTerminate;
  if (state.phase == Phase::kRunning) return To(state, Phase::kStopping, {Action::kStopWorker});
  if (state.phase == Phase::kStopped && state.has_maps) return To(state, Phase::kKeeping, {Action::kSaveCheckpoint});
  if (state.phase == Phase::kStopped && state.exit_code == 0) state.exit_code = kExitUnavailable;
  return Answered(state.has_worker ? Kill(state) : AfterWorker(state), answer);
}

ServiceStep Terminate(const ServiceState& state) {
  // First of all: whoever stops the service may kill it before the maps are saved.
  const bool has_record = state.procedure != ProcedurePhase::kNone && state.phase != Phase::kWiping;
  ServiceStep step = TakesTerminate(state.phase) ? Stop(state) : ServiceStep{state, {}};
  if (has_record && step.state.phase != Phase::kClosing && state.phase != Phase::kOver) {
    step.actions.insert(step.actions.begin(), Action::kRecordStopped);
  }
  return step;
}

ServiceStep InStartingOrWaiting(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kWorkerWaits: {
      const bool is_ended = IsEnd(state.purpose);
      if (is_ended) state.purpose = Purpose::kNone;
      const ServiceStep step = To(state, Phase::kWaiting);
      return is_ended ? Answered(step, Action::kSayDone) : step;
    }
    case Event::kWorkerReady:
      if (state.purpose == Purpose::kGoOn) return To(state, Phase::kLoading, {Action::kLoad});
      state.purpose = Purpose::kNone;
      return Answered(To(state, Phase::kReady), Action::kSayDone);
    case Event::kWorkerFails: {
      const Action answer = IsEnd(state.purpose) ? Action::kSayDone : Action::kSayFailed;
      state.purpose = Purpose::kFail;
      state.exit_code = event.code;
      return Answered(Kill(state), answer);
    }
    case Event::kFault:
    case Event::kWorkerGone: {
      if (state.phase == Phase::kWaiting) return WithoutWorker(state, event.kind == Event::kWorkerGone);
      if (event.kind == Event::kWorkerGone && !state.has_gone_on) {
        state.has_gone_on = true;
        return Renewed(state);
      }
      // One that cannot even start is the service manager's to try again, later.
      const Action answer = IsEnd(state.purpose) ? Action::kSayDone : Action::kSayFailed;
      state.purpose = Purpose::kFail;
      state.exit_code = kExitUnavailable;
      if (event.kind == Event::kFault) return Answered(Kill(state), answer);
      state.has_worker = false;
      return Answered(To(state, Phase::kOver, {Action::kLeave}), answer);
    }
    case Event::kEndKeep:
    case Event::kEndWipe:
      if (state.phase == Phase::kStarting || state.procedure == ProcedurePhase::kNone) return {state, {}};
      return End(state, event.kind);
    default: return {state, {}};
  }
}

ServiceStep InReady(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kBegin:
      if (state.procedure != ProcedurePhase::kNone) return {state, {}};
      state.purpose = Purpose::kBegin;
      state.procedure = ProcedurePhase::kOpen;
      state.owes_answer = true;
      state.has_gone_on = false;
      return To(state, Phase::kRecording, {Action::kRecordOpen});
    case Event::kResume:
      if (state.procedure != ProcedurePhase::kInterrupted) return {state, {}};
      state.purpose = Purpose::kResume;
      state.owes_answer = true;
      state.is_kept = state.has_gone_on = false;
      return To(state, Phase::kLoading, {Action::kLoad});
    case Event::kEndKeep:
    case Event::kEndWipe:
      return state.procedure == ProcedurePhase::kNone ? ServiceStep{state, {}} : End(state, event.kind);
    case Event::kFault: return WithoutWorker(state, false);
    case Event::kWorkerGone: return WithoutWorker(state, true);
    default: return {state, {}};
  }
}

// Loading, recording, beginning.
ServiceStep OnTheWay(ServiceState state, const ServiceEvent& event) {
  if (event.kind == Event::kFault || event.kind == Event::kWorkerGone) {
    return WithoutWorker(state, event.kind == Event::kWorkerGone);
  }
  if (state.phase == Phase::kLoading && event.kind == Event::kLoaded) {
    state.procedure = ProcedurePhase::kOpen;
    return To(state, Phase::kRecording, {Action::kRecordOpen});
  }
  if (state.phase == Phase::kLoading && event.kind == Event::kNotLoaded) {
    if (state.purpose == Purpose::kGoOn) {
      state.purpose = Purpose::kFail;
      state.exit_code = kExitUnavailable;
      return Kill(state);
    }
    // What it read stays in the worker; `end` throws both away.
    state.purpose = Purpose::kNone;
    return Answered(To(state, Phase::kReady), Action::kSayFailed);
  }
  if (state.phase == Phase::kRecording && event.kind == Event::kRecorded) {
    return To(state, Phase::kBeginning, {Action::kBeginWorker});
  }
  if (state.phase == Phase::kBeginning && event.kind == Event::kBegun) {
    state.purpose = Purpose::kNone;
    return Answered(To(state, Phase::kRunning), Action::kSayDone);
  }
  return {state, {}};
}

ServiceStep InRunning(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kFault: return WithoutWorker(state, false);
    case Event::kWorkerGone: return WithoutWorker(state, true);
    case Event::kSessionEnds:
      state.purpose = Purpose::kFail;
      state.exit_code = event.code;
      return To(state, Phase::kStopping, {Action::kStopWorker});
    case Event::kEndKeep:
    case Event::kEndWipe: return End(state, event.kind);
    default: return {state, {}};
  }
}

ServiceStep InStopping(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kStoppedWithMaps:
      state.has_maps = true;
      if (state.purpose == Purpose::kEndWipe) return Kill(state);
      if (state.purpose == Purpose::kEndKeep) return Keep(state);
      return To(state, Phase::kKeeping, {Action::kSaveCheckpoint});
    case Event::kStoppedWithoutMaps:
    case Event::kFault: return WithoutWorker(state, false);
    case Event::kWorkerGone: return WithoutWorker(state, true);
    default: return {state, {}};
  }
}

ServiceStep InKeeping(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kKept: state.is_kept = true; return state.has_worker ? Kill(state) : AfterWorker(state);
    case Event::kNotKept:
      if (state.purpose == Purpose::kEndKeep) {
        state.purpose = Purpose::kNone;
        // Of an interrupted procedure there is nothing but what lies on the disk, where it stays.
        if (state.procedure == ProcedurePhase::kInterrupted) {
          const bool is_over = state.exit_code != 0;
          return Answered(is_over ? To(state, Phase::kOver, {Action::kLeave}) : Renewed(state), Action::kSayFailed);
        }
        return Answered(To(state, Phase::kStopped), Action::kSayFailed);
      }
      if (state.exit_code == 0) state.exit_code = kExitIo;
      return state.has_worker ? Kill(state) : AfterWorker(state);
    case Event::kFault: return state.has_worker ? WithoutWorker(state, false) : ServiceStep{state, {}};
    case Event::kWorkerGone: return state.has_worker ? WithoutWorker(state, true) : ServiceStep{state, {}};
    default: return {state, {}};
  }
}

ServiceStep InStopped(ServiceState state, const ServiceEvent& event) {
  switch (event.kind) {
    case Event::kEndKeep:
    case Event::kEndWipe: return End(state, event.kind);
    case Event::kFault: state.has_maps = false; return To(state, Phase::kStopped, {Action::kKillWorker});
    case Event::kWorkerGone: state.has_worker = state.has_maps = false; return {state, {}};
    default: return {state, {}};
  }
}

ServiceStep InReaping(ServiceState state, const ServiceEvent& event) {
  if (event.kind == Event::kWorkerGone) return AfterWorker(state);
  // On its way to the disk when the worker was killed.
  if (event.kind == Event::kKept && state.purpose == Purpose::kEndKeep) state.is_kept = true;
  if (event.kind == Event::kTimeUp) {
    // The kernel cannot end it: it hangs in a driver. No other worker can use that device. What is left to do is done.
    if (state.exit_code == 0) state.exit_code = kExitUnavailable;
    if (!IsEnd(state.purpose) && state.purpose != Purpose::kTerminate) state.purpose = Purpose::kFail;
    return AfterWorker(state);
  }
  return {state, {}};
}

}  // namespace

ServiceStep Next(const ServiceState& state, const ServiceEvent& given) {
  ServiceEvent event = given;
  // A limit that is over is a fault of the worker, but while it is reaped.
  if (event.kind == Event::kTimeUp && state.phase != Phase::kReaping) event.kind = Event::kFault;
  if (event.kind == Event::kTerminate) return Terminate(state);
  switch (state.phase) {
    case Phase::kDown: return event.kind == Event::kStart ? Renewed(state) : ServiceStep{state, {}};
    case Phase::kStarting:
    case Phase::kWaiting: return InStartingOrWaiting(state, event);
    case Phase::kReady: return InReady(state, event);
    case Phase::kLoading:
    case Phase::kRecording:
    case Phase::kBeginning: return OnTheWay(state, event);
    case Phase::kRunning: return InRunning(state, event);
    case Phase::kStopping: return InStopping(state, event);
    case Phase::kKeeping: return InKeeping(state, event);
    case Phase::kStopped: return InStopped(state, event);
    case Phase::kReaping: return InReaping(state, event);
    case Phase::kWiping: {
      if (event.kind != Event::kWiped && event.kind != Event::kNotWiped) return {state, {}};
      ServiceState ended = state;
      ended.has_gone_on = false;
      if (event.kind == Event::kWiped) {
        ended.procedure = ProcedurePhase::kNone;
        ended.is_kept = false;
      } else {
        // What is left is of this patient: no other procedure begins before an `end` comes through.
        ended.procedure = ProcedurePhase::kInterrupted;
      }
      if (ended.exit_code == 0) return Renewed(ended);
      return Answered(To(ended, Phase::kOver, {Action::kLeave}), Action::kSayDone);
    }
    case Phase::kClosing:
      return event.kind == Event::kRecorded ? To(state, Phase::kOver, {Action::kLeave}) : ServiceStep{state, {}};
    case Phase::kOver: return {state, {}};
  }
  return {state, {}};
}

std::string_view ToString(ServicePhase phase) {
  constexpr std::string_view kNames[] = {"down",      "starting",  "waiting", "ready",    "loading",
                                         "recording", "beginning", "running", "stopping", "keeping",
                                         "stopped",   "reaping",   "wiping",  "closing",  "over"};
  static_assert(std::size(kNames) == kNumServicePhases);
  return kNames[static_cast<std::size_t>(phase)];
}

std::string_view ToString(ServiceEventKind event) {
  constexpr std::string_view kNames[] = {
      "start",    "worker_waits",      "worker_ready",         "worker_fails", "loaded",   "not_loaded", "recorded",
      "begun",    "stopped_with_maps", "stopped_without_maps", "kept",         "not_kept", "wiped",      "not_wiped",
      "fault",    "session_ends",      "worker_gone",          "time_up",      "begin",    "resume",     "end_keep",
      "end_wipe", "terminate"};
  static_assert(std::size(kNames) == kNumServiceEvents);
  return kNames[static_cast<std::size_t>(event)];
}

std::string_view ToString(ServiceAction action) {
  constexpr std::string_view kNames[] = {
      "start_worker",    "load",        "record_open", "begin_worker",   "stop_worker", "keep_maps",  "keep_checkpoint",
      "save_checkpoint", "kill_worker", "wipe",        "record_stopped", "say_done",    "say_failed", "leave"};
  return kNames[static_cast<std::size_t>(action)];
}

}  // namespace haustra
