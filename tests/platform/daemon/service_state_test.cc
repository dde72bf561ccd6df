// The states of haustrad as a table: rows that were thought of, and what holds in all states that can be reached.
#include "platform/daemon/service_state.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "platform/exit_codes.h"

namespace haustra {
namespace {

using P = ServicePhase;
using E = ServiceEventKind;
using A = ServiceAction;
using Actions = std::vector<ServiceAction>;

std::string Text(const ServiceState& state) {
  return std::string(ToString(state.phase)) + " procedure " + std::to_string(static_cast<int>(state.procedure)) +
         " purpose " + std::to_string(static_cast<int>(state.purpose)) + (state.owes_answer ? " owes" : "") +
         (state.has_worker ? " worker" : "") + (state.has_maps ? " maps" : "") + (state.is_kept ? " kept" : "") +
         (state.has_gone_on ? " gone_on" : "") + " code " + std::to_string(state.exit_code);
}

// Follows events, and checks what each is answered with.
class Walk {
 public:
  explicit Walk(ProcedurePhase procedure = ProcedurePhase::kNone) { state_.procedure = procedure; }
  Walk& Takes(ServiceEvent event, P phase, const Actions& actions) {
    const ServiceStep step = Next(state_, event);
    EXPECT_EQ(ToString(step.state.phase), ToString(phase)) << ToString(event.kind) << " in " << Text(state_);
    EXPECT_EQ(step.actions, actions) << ToString(event.kind) << " in " << Text(state_);
    state_ = step.state;
    return *this;
  }
  Walk& Takes(E event, P phase, const Actions& actions = {}) { return Takes(ServiceEvent{event}, phase, actions); }
  Walk& Ready() { return Takes(E::kStart, P::kStarting, {A::kStartWorker}).Takes(E::kWorkerReady, P::kReady); }
  Walk& Running() {
    return Ready()
        .Takes(E::kBegin, P::kRecording, {A::kRecordOpen})
        .Takes(E::kRecorded, P::kBeginning, {A::kBeginWorker})
        .Takes(E::kBegun, P::kRunning, {A::kSayDone});
  }
  const ServiceState& state() const { return state_; }

 private:
  ServiceState state_;
};

TEST(ServiceState, ProcedureBeginsAndEndsWithAWorkerOfItsOwn) {
  RecordProperty("req", "DATA-002");
  Walk()
      .Running()
      .Takes(E::kEndWipe, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerReady, P::kReady, {A::kSayDone})
      .Takes(E::kBegin, P::kRecording, {A::kRecordOpen});
}

TEST(ServiceState, WhatIsKeptIsOnTheDiskBeforeTheWorkerGoes) {
  Walk()
      .Running()
      .Takes(E::kEndKeep, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kKeepMaps})
      .Takes(E::kKept, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe});
}

// Maps that come to the disk after their worker was killed are not replaced by a checkpoint.
TEST(ServiceState, WhatIsKeptWhileTheWorkerIsReapedIsKept) {
  RecordProperty("req", "DMN-005,DMN-010");
  Walk()
      .Running()
      .Takes(E::kEndKeep, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kKeepMaps})
      .Takes(E::kTimeUp, P::kReaping, {A::kKillWorker})
      .Takes(E::kKept, P::kReaping)
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe});
  // Of another purpose it says nothing about what is to be kept later.
  Walk going_on;
  going_on.Running().Takes(E::kFault, P::kReaping, {A::kKillWorker}).Takes(E::kKept, P::kReaping);
  EXPECT_FALSE(going_on.state().is_kept);
}

TEST(ServiceState, WhatCannotBeKeptIsNotWiped) {
  RecordProperty("req", "DMN-009");
  Walk walk;
  walk.Running()
      .Takes(E::kEndKeep, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kKeepMaps})
      .Takes(E::kNotKept, P::kStopped, {A::kSayFailed});
  Walk again = walk;
  again.Takes(E::kEndKeep, P::kKeeping, {A::kKeepMaps}).Takes(E::kKept, P::kReaping, {A::kKillWorker});
  again = walk;
  again.Takes(E::kEndWipe, P::kReaping, {A::kKillWorker}).Takes(E::kWorkerGone, P::kWiping, {A::kWipe});
  again = walk;
  again.Takes(E::kTerminate, P::kKeeping, {A::kRecordStopped, A::kSaveCheckpoint});
  // The worker that holds them fails: the checkpoint is what there is.
  again = walk;
  again.Takes(E::kWorkerGone, P::kStopped).Takes(E::kEndKeep, P::kKeeping, {A::kKeepCheckpoint});
  again.Takes(E::kNotKept, P::kStopped, {A::kSayFailed});
  again.Takes(E::kTerminate, P::kClosing, {A::kRecordStopped});
  EXPECT_EQ(again.state().exit_code, kExitUnavailable);
}

TEST(ServiceState, FaultCostsOneWorkerAndTheProcedureGoesOn) {
  RecordProperty("req", "DMN-010");
  for (const E event : {E::kFault, E::kWorkerGone}) {
    Walk walk;
    walk.Running();
    if (event == E::kFault) walk.Takes(event, P::kReaping, {A::kKillWorker});
    walk.Takes(E::kWorkerGone, P::kStarting, {A::kStartWorker})
        .Takes(E::kWorkerReady, P::kLoading, {A::kLoad})
        .Takes(E::kLoaded, P::kRecording, {A::kRecordOpen})
        .Takes(E::kRecorded, P::kBeginning, {A::kBeginWorker})
        .Takes(E::kBegun, P::kRunning);
    EXPECT_EQ(walk.state().procedure, ProcedurePhase::kOpen);
    // Once a procedure.
    walk.Takes(E::kFault, P::kReaping, {A::kKillWorker}).Takes(E::kWorkerGone, P::kOver, {A::kLeave});
    EXPECT_EQ(walk.state().exit_code, kExitUnavailable);
    EXPECT_EQ(walk.state().procedure, ProcedurePhase::kOpen);
  }
}

TEST(ServiceState, WorkerThatDiesWhileItBeginsIsReplacedAndTheAnswerComes) {
  Walk()
      .Ready()
      .Takes(E::kBegin, P::kRecording, {A::kRecordOpen})
      .Takes(E::kWorkerGone, P::kStarting, {A::kStartWorker})
      .Takes(E::kRecorded, P::kStarting)  // late
      .Takes(E::kWorkerReady, P::kLoading, {A::kLoad})
      .Takes(E::kLoaded, P::kRecording, {A::kRecordOpen})
      .Takes(E::kRecorded, P::kBeginning, {A::kBeginWorker})
      .Takes(E::kBegun, P::kRunning, {A::kSayDone});
}

TEST(ServiceState, InterruptedProcedureWaitsForItsWord) {
  RecordProperty("req", "DATA-003");
  Walk walk(ProcedurePhase::kInterrupted);
  walk.Ready().Takes(E::kBegin, P::kReady);
  Walk resumed = walk;
  resumed.Takes(E::kResume, P::kLoading, {A::kLoad})
      .Takes(E::kLoaded, P::kRecording, {A::kRecordOpen})
      .Takes(E::kRecorded, P::kBeginning, {A::kBeginWorker})
      .Takes(E::kBegun, P::kRunning, {A::kSayDone});
  Walk damaged = walk;
  damaged.Takes(E::kResume, P::kLoading, {A::kLoad}).Takes(E::kNotLoaded, P::kReady, {A::kSayFailed});
  EXPECT_EQ(damaged.state().procedure, ProcedurePhase::kInterrupted);
  // A file that brings the worker down is as good as damaged, and the next one is not given it by itself.
  damaged.Takes(E::kResume, P::kLoading, {A::kLoad})
      .Takes(E::kWorkerGone, P::kStarting, {A::kSayFailed, A::kStartWorker})
      .Takes(E::kWorkerReady, P::kReady);
  EXPECT_EQ(damaged.state().procedure, ProcedurePhase::kInterrupted);
  // The worker read some of it: it goes, too.
  damaged.Takes(E::kEndWipe, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerWaits, P::kWaiting, {A::kSayDone});
  EXPECT_EQ(damaged.state().procedure, ProcedurePhase::kNone);
}

// What is left of it could come into the next patient's procedure.
TEST(ServiceState, WhatCannotBeWipedKeepsTheNextProcedureOut) {
  RecordProperty("req", "DATA-001,DATA-003");
  Walk walk;
  walk.Running()
      .Takes(E::kEndWipe, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kNotWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerReady, P::kReady, {A::kSayDone})
      .Takes(E::kBegin, P::kReady);
  EXPECT_EQ(walk.state().procedure, ProcedurePhase::kInterrupted);
  walk.Takes(E::kEndWipe, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerReady, P::kReady, {A::kSayDone})
      .Takes(E::kBegin, P::kRecording, {A::kRecordOpen});
}

TEST(ServiceState, WhatWasKeptAndCannotBeWipedIsKeptOnce) {
  Walk walk;
  walk.Running()
      .Takes(E::kEndKeep, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kKeepMaps})
      .Takes(E::kKept, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kNotWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerReady, P::kReady, {A::kSayDone});
  Walk resumed = walk;
  walk.Takes(E::kEndKeep, P::kReaping, {A::kKillWorker}).Takes(E::kWorkerGone, P::kWiping, {A::kWipe});
  // What comes after it went on is to be kept, too.
  resumed.Takes(E::kResume, P::kLoading, {A::kLoad})
      .Takes(E::kLoaded, P::kRecording, {A::kRecordOpen})
      .Takes(E::kRecorded, P::kBeginning, {A::kBeginWorker})
      .Takes(E::kBegun, P::kRunning, {A::kSayDone})
      .Takes(E::kEndKeep, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kKeepMaps});
}

TEST(ServiceState, StopSavesAndSaysSo) {
  RecordProperty("req", "DMN-004,DATA-003");
  Walk walk;
  // The record is before the save, which may take longer than the service is given.
  walk.Running()
      .Takes(E::kTerminate, P::kStopping, {A::kRecordStopped, A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kKeeping, {A::kSaveCheckpoint});
  Walk full = walk;
  walk.Takes(E::kKept, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kClosing, {A::kRecordStopped})
      .Takes(E::kRecorded, P::kOver, {A::kLeave});
  EXPECT_EQ(walk.state().exit_code, kExitOk);
  full.Takes(E::kNotKept, P::kReaping, {A::kKillWorker}).Takes(E::kWorkerGone, P::kClosing, {A::kRecordStopped});
  EXPECT_EQ(full.state().exit_code, kExitIo);
  Walk hung;
  hung.Running()
      .Takes(E::kTerminate, P::kStopping, {A::kRecordStopped, A::kStopWorker})
      .Takes(E::kTimeUp, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kClosing, {A::kRecordStopped});
  EXPECT_EQ(hung.state().exit_code, kExitUnavailable);
}

TEST(ServiceState, InterruptedProcedureIsStoppedWithTheService) {
  RecordProperty("req", "DATA-003");
  Walk walk(ProcedurePhase::kInterrupted);
  walk.Takes(E::kStart, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerWaits, P::kWaiting)
      .Takes(E::kTerminate, P::kReaping, {A::kRecordStopped, A::kKillWorker})
      .Takes(E::kWorkerGone, P::kClosing, {A::kRecordStopped})
      .Takes(E::kRecorded, P::kOver, {A::kLeave});
  EXPECT_EQ(walk.state().exit_code, kExitOk);
}

TEST(ServiceState, StopThatMustWaitItsTurnIsRecordedAtOnce) {
  RecordProperty("req", "DATA-003");
  Walk walk(ProcedurePhase::kInterrupted);
  walk.Ready()
      .Takes(E::kResume, P::kLoading, {A::kLoad})
      .Takes(E::kTerminate, P::kLoading, {A::kRecordStopped})
      .Takes(E::kLoaded, P::kRecording, {A::kRecordOpen});
  EXPECT_FALSE(TakesTerminate(P::kLoading));
}

TEST(ServiceState, EndComesThroughWhenTheWorkerCannotBeKilled) {
  RecordProperty("req", "DMN-010");
  Walk walk;
  walk.Running()
      .Takes(E::kEndWipe, P::kStopping, {A::kStopWorker})
      .Takes(E::kTimeUp, P::kReaping, {A::kKillWorker})
      .Takes(E::kTimeUp, P::kWiping, {A::kWipe})
      .Takes(E::kWiped, P::kOver, {A::kSayDone, A::kLeave});
  EXPECT_EQ(walk.state().exit_code, kExitUnavailable);
}

TEST(ServiceState, WorkerThatCannotStartEndsTheServiceWithItsReason) {
  RecordProperty("req", "DMN-001");
  Walk walk;
  walk.Takes(E::kStart, P::kStarting, {A::kStartWorker})
      .Takes({E::kWorkerFails, kExitNoInput}, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kOver, {A::kLeave});
  EXPECT_EQ(walk.state().exit_code, kExitNoInput);
}

TEST(ServiceState, WorkerThatDiesWhileItStartsIsTriedOnceMore) {
  RecordProperty("req", "DMN-010");
  Walk walk;
  walk.Running()
      .Takes(E::kEndWipe, P::kStopping, {A::kStopWorker})
      .Takes(E::kStoppedWithMaps, P::kReaping, {A::kKillWorker})
      .Takes(E::kWorkerGone, P::kWiping, {A::kWipe})
      .Takes(E::kWiped, P::kStarting, {A::kStartWorker})
      .Takes(E::kWorkerGone, P::kStarting, {A::kStartWorker});
  Walk(walk).Takes(E::kWorkerReady, P::kReady, {A::kSayDone});
  walk.Takes(E::kWorkerGone, P::kOver, {A::kSayDone, A::kLeave});
  EXPECT_EQ(walk.state().exit_code, kExitUnavailable);
}

// --- All states.

struct Less {
  static auto Key(const ServiceState& s) {
    return std::tuple(s.phase, s.procedure, s.purpose, s.owes_answer, s.has_worker, s.has_maps, s.is_kept,
                      s.has_gone_on, s.exit_code);
  }
  bool operator()(const ServiceState& a, const ServiceState& b) const { return Key(a) < Key(b); }
};

std::set<ServiceState, Less> Reachable() {
  std::set<ServiceState, Less> known;
  std::deque<ServiceState> open;
  for (const ProcedurePhase procedure : {ProcedurePhase::kNone, ProcedurePhase::kInterrupted}) {
    ServiceState state;
    state.procedure = procedure;
    known.insert(state);
    open.push_back(state);
  }
  for (; !open.empty(); open.pop_front()) {
    for (int i = 0; i < kNumServiceEvents; ++i) {
      const ServiceStep step = Next(open.front(), {static_cast<E>(i), kExitBadData});
      if (known.insert(step.state).second) open.push_back(step.state);
    }
  }
  return known;
}

bool Has(const Actions& actions, A action) {
  return std::find(actions.begin(), actions.end(), action) != actions.end();
}

TEST(ServiceState, WhatHoldsInEveryStateThatCanBeReached) {
  RecordProperty("req", "DATA-002,DATA-003");
  const std::set<ServiceState, Less> states = Reachable();
  RecordProperty("num_states", static_cast<int>(states.size()));
  for (const ServiceState& state : states) {
    if (state.phase == P::kRunning) {
      EXPECT_TRUE(state.has_worker) << Text(state);
      EXPECT_EQ(state.procedure, ProcedurePhase::kOpen) << Text(state);
      EXPECT_FALSE(state.owes_answer) << Text(state);
    }
    if (state.has_maps) {
      EXPECT_TRUE(state.has_worker) << Text(state);
    }
    if (state.phase == P::kOver) {
      EXPECT_FALSE(state.owes_answer) << Text(state);
    }
    if (TakesRequests(state.phase) && state.phase != P::kWaiting) {
      EXPECT_FALSE(state.owes_answer) << Text(state);
    }
    for (int i = 0; i < kNumServiceEvents; ++i) {
      const E event = static_cast<E>(i);
      const ServiceStep step = Next(state, {event, kExitBadData});
      const std::string text = std::string(ToString(event)) + " in " + Text(state);
      // One worker at a time, and none for two procedures: who begins one has a worker that has begun none before.
      if (Has(step.actions, A::kStartWorker)) {
        EXPECT_TRUE(!state.has_worker || event == E::kWorkerGone) << text;
      }
      if (Has(step.actions, A::kRecordOpen)) {
        EXPECT_TRUE(state.phase == P::kReady || state.phase == P::kLoading) << text;
      }
      // Data go only when somebody said so, and nobody holds them any more.
      if (Has(step.actions, A::kWipe)) {
        EXPECT_FALSE(step.state.has_worker) << text;
        EXPECT_TRUE(step.state.purpose == ServicePurpose::kEndWipe || step.state.is_kept) << text;
      }
      if (step.state.procedure != state.procedure && step.state.procedure == ProcedurePhase::kNone) {
        EXPECT_EQ(event, E::kWiped) << text;
      }
      // Whoever stops the service finds that recorded before anything else is done. What is being wiped has no record.
      if (event == E::kTerminate && state.procedure != ProcedurePhase::kNone && state.phase != P::kWiping &&
          state.phase != P::kClosing && state.phase != P::kOver) {
        const auto first = std::find_if(step.actions.begin(), step.actions.end(),
                                        [](A action) { return action != A::kSayDone && action != A::kSayFailed; });
        EXPECT_TRUE(first != step.actions.end() && *first == A::kRecordStopped) << text;
      }
      // Each answer that is owed is given once.
      const auto num_answers = std::count_if(step.actions.begin(), step.actions.end(),
                                             [](A action) { return action == A::kSayDone || action == A::kSayFailed; });
      EXPECT_LE(num_answers, 1) << text;
      // What has been wiped has been ended.
      if (state.procedure == ProcedurePhase::kNone && state.owes_answer && Has(step.actions, A::kSayFailed)) {
        EXPECT_NE(state.purpose, ServicePurpose::kEndWipe) << text;
        EXPECT_NE(state.purpose, ServicePurpose::kEndKeep) << text;
      }
      EXPECT_EQ(num_answers == 1, state.owes_answer && !step.state.owes_answer) << text;
    }
  }
}

// Whatever happened before: when each action is answered for, a worker that is killed goes, and nothing else fails, the
// service is settled after some steps; and then a stop ends it.
TEST(ServiceState, NoStateIsADeadEnd) {
  RecordProperty("req", "DMN-004");
  const auto settle = [](ServiceState state) {
    for (int i = 0; i < 30; ++i) {
      E event = E::kStart;
      switch (state.phase) {
        case P::kStarting: event = E::kWorkerReady; break;
        case P::kLoading: event = E::kLoaded; break;
        case P::kRecording:
        case P::kClosing: event = E::kRecorded; break;
        case P::kBeginning: event = E::kBegun; break;
        case P::kStopping: event = E::kStoppedWithMaps; break;
        case P::kKeeping: event = E::kKept; break;
        case P::kReaping: event = E::kWorkerGone; break;
        case P::kWiping: event = E::kWiped; break;
        case P::kDown: event = E::kStart; break;
        default: return state;
      }
      state = Next(state, {event}).state;
    }
    return state;
  };
  for (const ServiceState& state : Reachable()) {
    const ServiceState settled = settle(state);
    EXPECT_TRUE(TakesRequests(settled.phase) || settled.phase == P::kOver)
        << Text(state) << " comes to " << Text(settled);
    if (settled.phase == P::kOver) continue;
    const ServiceState over = settle(Next(settled, {E::kTerminate}).state);
    EXPECT_EQ(ToString(over.phase), ToString(P::kOver)) << Text(settled);
    EXPECT_FALSE(over.has_worker) << Text(settled);
  }
}

}  // namespace
}  // namespace haustra
