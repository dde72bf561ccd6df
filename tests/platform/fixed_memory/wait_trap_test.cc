// That the trap catches what it should, and that tracking gives it nothing to catch: neither through full pools,
// checkpoints and joins, nor when the device is lost.
#include "platform/trap/wait_trap.h"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <shared_mutex>
#include <thread>

#include "hal/core/byte_sink.h"
#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/published_records.h"
#include "platform/realtime/wake_signal.h"
#include "platform/session/session.h"
#include "platform/session/watched_vision_device.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

constexpr const char* kNoLocks = "locks cannot be watched in this build";
constexpr const char* kNoSystemCalls = "this kernel does not tell of system calls";

// A thread that is watched stays so: each test has one of its own.
template <typename Work>
void OnAThread(const Work& work) {
  std::thread(work).join();
}

TEST(WaitTrap, CountsLocksOfItsThreadWhileItIsArmed) {
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << kNoLocks;
  OnAThread([] {
    std::mutex mutex;
    std::shared_mutex shared;
    std::uint32_t num_before = 0;
    {
      const WaitTrap trap(WaitTrap::Mode::kCount);
      num_before = WaitTrap::num_locks();
      { const std::lock_guard lock(mutex); }
      { const std::shared_lock lock(shared); }
      { const std::unique_lock lock(shared); }
      EXPECT_EQ(WaitTrap::num_locks(), num_before + 3);
      { const std::unique_lock lock(mutex, std::try_to_lock); }
      {
        const WaitTrap pause(WaitTrap::Mode::kOff);
        const std::lock_guard lock(mutex);
      }
      EXPECT_EQ(WaitTrap::num_locks(), num_before + 3);
    }
    { const std::lock_guard lock(mutex); }
    EXPECT_EQ(WaitTrap::num_locks(), num_before + 3);
  });
}

TEST(WaitTrap, CountsSystemCallsButNoWakeUp) {
  bool is_told = false;
  OnAThread([&] {
    is_told = WaitTrap::CatchSystemCalls();
    if (!is_told) return;
    WakeSignal signal;
    std::thread sleeper([&signal] { EXPECT_TRUE(signal.WaitFor(std::chrono::seconds(600))); });
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // asleep by then, most likely
    {
      const WaitTrap trap(WaitTrap::Mode::kCount);
      signal.Post();
      EXPECT_EQ(WaitTrap::num_system_calls(), 0u);
      (void)::getppid();
      EXPECT_EQ(WaitTrap::num_system_calls(), 1u);
      EXPECT_EQ(WaitTrap::last_system_call(), SYS_getppid);
      const timespec moment{0, 1000};
      ::nanosleep(&moment, nullptr);
      EXPECT_EQ(WaitTrap::num_system_calls(), 2u);
    }
    (void)::getppid();
    EXPECT_EQ(WaitTrap::num_system_calls(), 2u);
    sleeper.join();
  });
  if (!is_told) GTEST_SKIP() << kNoSystemCalls;
}

TEST(WaitTrapDeathTest, AbortNamesWhatItCaught) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << kNoLocks;
  const auto lock = [] {
    std::mutex mutex;
    const WaitTrap trap(WaitTrap::Mode::kAbort);
    mutex.lock();
  };
  EXPECT_DEATH(lock(), "wait trap: pthread_mutex_lock on a thread that must not wait");
  bool is_told = false;
  OnAThread([&is_told] { is_told = WaitTrap::CatchSystemCalls(); });
  if (!is_told) GTEST_SKIP() << kNoSystemCalls;
  const auto call = [] {
    (void)WaitTrap::CatchSystemCalls();
    const WaitTrap trap(WaitTrap::Mode::kAbort);
    (void)::getppid();
  };
  EXPECT_DEATH(call(), "wait trap: system call [0-9]+ on a thread that must not wait");
}

// Calls it with the trap off.
template <typename Call>
auto Unwatched(const Call& call) {
  const WaitTrap pause(WaitTrap::Mode::kOff);
  return call();
}

// The scripted device is a fake with a lock of its own; what it does is not looked at. When it is lost it says so.
class UnwatchedDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<FeatureSetHandle> CreateFeatureSet() override {
    return Unwatched([&] { return ForwardingVisionDevice::CreateFeatureSet(); });
  }
  bool RetainFeatureSet(FeatureSetHandle set) override {
    return Unwatched([&] { return ForwardingVisionDevice::RetainFeatureSet(set); });
  }
  void ReleaseFeatureSet(FeatureSetHandle set) override {
    Unwatched([&] { ForwardingVisionDevice::ReleaseFeatureSet(set); });
  }
  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (is_lost) return Status(StatusCode::kUnavailable);
    return Unwatched([&] { return ForwardingVisionDevice::EnqueueExtract(lane, request); });
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    if (is_lost) return Status(StatusCode::kUnavailable);
    return Unwatched([&] { return ForwardingVisionDevice::EnqueueMatch(lane, request); });
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    if (is_lost) return Status(StatusCode::kUnavailable);
    return Unwatched([&] { return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request); });
  }
  Status Wait(Ticket ticket, TimePoint deadline) override {
    if (is_lost) return Status(StatusCode::kUnavailable);
    return Unwatched([&] { return ForwardingVisionDevice::Wait(ticket, deadline); });
  }

  std::atomic<bool> is_lost{false};
};

class WaitWatcher final : public test::RecordingObserver {
 public:
  const ThreadWatch* thread_watch() const override { return &CountingWaitWatch(); }

  int Count(MapEventKind kind) const {
    return static_cast<int>(
        std::count_if(events.begin(), events.end(), [kind](const MapEvent& event) { return event.kind == kind; }));
  }
  void ExpectNoWaits() const {
    for (const FrameOutcome& frame : frames) {
      EXPECT_EQ(frame.use.trapped_calls, 0u)
          << "frame " << frame.result.frame_index << ' ' << ToString(frame.result.reason);
    }
  }
};

// A checkpoint whenever the mapper has a moment, beside tracking, which publishes each answer as the service does.
class AlwaysSaves final : public SessionHooks {
 public:
  AlwaysSaves(const Engine& engine, PoseRingWriter& ring) : engine_(engine), ring_(ring) {}
  void OnTracked(const FrameOutcome& outcome) override {
    ring_.PublishPose(PoseRecord(outcome.result, {}, outcome.due, outcome.due, 1));
  }
  void BetweenMapSteps() override {
    StringSink sink;
    if (num_calls_++ % 8 == 0) num_saves += engine_.SaveAtlas(sink).ok();
  }
  int num_saves = 0;

 private:
  const Engine& engine_;
  PoseRingWriter& ring_;
  int num_calls_ = 0;
};

struct WatchedRun {
  Status status;
  int num_saves = 0;
  std::uint64_t num_evicted = 0;
};

WatchedRun RunWatched(test::ScriptedColon& colon, UnwatchedDevice& inner, WaitWatcher* observer) {
  const SystemClock clock;
  WatchedVisionDevice device(inner, clock, std::chrono::seconds(600));
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, device, &clock);
  const std::string path = testing::TempDir() + "wait_trap_poses_" + std::to_string(::getpid());
  const auto ring = PoseRingWriter::Create(path, 0600, ::getgid()).value();
  ::unlink(path.c_str());
  AlwaysSaves hooks(*engine, *ring);
  RealTimeOptions options;
  options.rate = 2.0;
  options.rt.enabled = false;
  options.hooks = &hooks;
  options.device = &device;
  const auto session = RunRealTime(colon.source(), *engine, clock, options, *observer, test::kNeverStop);
  return {session.status(), hooks.num_saves, engine->evictions().num_keyframes};
}

TEST(WaitTrap, TrackingWaitsForNothingThroughFullPoolsCheckpointsAndJoins) {
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << kNoLocks;
  EngineConfig config = test::SmallEngineConfig();
  config.memory.max_keyframes = 26;
  config.memory.spare_feature_sets = 3;
  config.scheduler.deadline_ms = 10000.0;
  test::ScriptedColon colon(TimePoint{}, config);
  colon.Move(0.0, 2.0, 55);
  colon.Occlude(6);
  colon.Move(7.0, 8.0, 35);
  colon.Occlude(6);
  colon.Move(1.9, 8.2, 160);
  UnwatchedDevice device(colon.device());
  WaitWatcher observer;
  const WatchedRun outcome = RunWatched(colon, device, &observer);
  ASSERT_TRUE(outcome.status.ok()) << outcome.status.ToString();
  observer.ExpectNoWaits();
  EXPECT_GT(outcome.num_saves, 0);
  EXPECT_GT(outcome.num_evicted, 0u);
  EXPECT_GE(observer.Count(MapEventKind::kMapCreated), 2);
  EXPECT_GE(observer.Count(MapEventKind::kMerged), 1);
}

TEST(WaitTrap, TrackingWaitsForNothingWhenTheDeviceIsLost) {
  if (!WaitTrap::CatchesLocks()) GTEST_SKIP() << kNoLocks;
  test::ScriptedColon colon;
  colon.Move(0.0, 4.0, 100);
  colon.Occlude(100000);
  UnwatchedDevice device(colon.device());
  WaitWatcher observer;
  observer.on_frame = [&](const FrameOutcome& outcome) {
    if (outcome.result.frame_index >= 60) device.is_lost = true;
  };
  EXPECT_EQ(RunWatched(colon, device, &observer).status.code(), StatusCode::kUnavailable);
  observer.ExpectNoWaits();
}

}  // namespace
}  // namespace haustra
