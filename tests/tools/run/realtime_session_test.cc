// The threads of a real-time session, held and let go by the test where their order matters; no time is asserted.
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <functional>
#include <semaphore>
#include <string>
#include <thread>
#include <vector>

#include "engine/atlas/invariants.h"
#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "tests/sanitized.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using test::RecordingObserver;
using test::ScriptedColon;

constexpr double kFast = 1000.0;  // 25 000 frames a second: the pace never waits
// Calls `before_extract` on the tracking thread before each extraction.
class HookedDevice final : public ForwardingVisionDevice {
 public:
  HookedDevice(VisionDevice& device, std::function<void()> before_extract)
      : ForwardingVisionDevice(device), before_extract_(std::move(before_extract)) {}

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    before_extract_();
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }

 private:
  std::function<void()> before_extract_;
};

// Notes which thread its helpers are to follow, and which one extracts.
class FollowingDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    if (served != std::this_thread::get_id()) ++num_not_served;
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Status ServeThisThread(Lane lane) override {
    EXPECT_EQ(lane, Lane::kTracking);
    served = std::this_thread::get_id();
    return answer;
  }

  Status answer;
  std::thread::id served;
  int num_not_served = 0;
};

// Calls `before_next` with the number of the call, from 0, on the capture thread.
class HookedSource final : public FrameSource {
 public:
  HookedSource(FrameSource& source, std::function<void(int)> before_next)
      : source_(source), before_next_(std::move(before_next)) {}

  const CameraCalibration& calibration() const override { return source_.calibration(); }
  std::uint32_t num_frames() const override { return source_.num_frames(); }
  ImageView static_mask() const override { return source_.static_mask(); }
  Result<Frame> Next(TimePoint deadline) override {
    before_next_(num_calls_++);
    return source_.Next(deadline);
  }

 private:
  FrameSource& source_;
  std::function<void(int)> before_next_;
  int num_calls_ = 0;
};

// Capture waits until tracking has begun with the frame before, so that none is dropped; for sources without damage.
struct Lockstep {
  explicit Lockstep(ScriptedColon& colon) : Lockstep(colon, colon.source()) {}
  Lockstep(ScriptedColon& colon, FrameSource& frames)
      : device(colon.device(), [this] { tracking_began.release(); }), source(frames, [this](int call) {
          if (call > 0) tracking_began.acquire();
        }) {}
  std::counting_semaphore<> tracking_began{0};
  HookedDevice device;
  HookedSource source;
};

TEST(RealTimeSession, FramesThatTrackingKeepsUpWithAreAllAnswered) {
  ScriptedColon colon;
  colon.Occlude(20);
  Lockstep lockstep(colon);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  RecordingObserver observer;
  const auto session = RunRealTime(lockstep.source, *engine, SystemClock(), kFast, observer, test::kNeverStop);
  ASSERT_TRUE(session.ok()) << session.status().ToString();
  ASSERT_EQ(observer.frames.size(), 20u);
  for (std::uint32_t i = 0; i < 20; ++i) {
    EXPECT_EQ(observer.frames[i].result.frame_index, i);
    EXPECT_EQ(observer.frames[i].result.timestamp, colon.TimeOf(i));
    EXPECT_FALSE(observer.frames[i].is_dropped || observer.frames[i].is_damaged) << i;
  }
  EXPECT_EQ(session->video_time, 20 * test::kFramePeriod);
}

TEST(RealTimeSession, HelpersOfTheDeviceFollowTheTrackingThread) {
  ScriptedColon colon;
  colon.Occlude(20);
  FollowingDevice device(colon.device());
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, device);
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(colon.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  EXPECT_NE(device.served, std::thread::id());
  EXPECT_EQ(device.num_not_served, 0);
}

TEST(RealTimeSession, SlowTrackingGetsTheNewestFrameAndTheOthersCountAsDropped) {
  ScriptedColon colon;
  colon.Occlude(12);
  std::binary_semaphore tracking_began{0}, source_is_over{0};
  HookedDevice device(colon.device(), [&, is_first = true]() mutable {
    if (!is_first) return;
    is_first = false;
    tracking_began.release();
    source_is_over.acquire();
  });
  HookedSource source(colon.source(), [&](int call) {
    if (call == 1) tracking_began.acquire();
    if (call == 12) source_is_over.release();
  });
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, device);
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 12u);
  for (std::uint32_t i = 0; i < 12; ++i) {
    EXPECT_EQ(observer.frames[i].result.frame_index, i);
    EXPECT_EQ(observer.frames[i].is_dropped, i != 0 && i != 11) << i;
    EXPECT_EQ(observer.frames[i].result.timestamp, colon.TimeOf(i));
  }
}

TEST(RealTimeSession, FramesThatASlowObserverLeavesUnreadAreCountedAndReportedAsDropped) {
  ScriptedColon colon;
  colon.Occlude(20);
  Lockstep lockstep(colon);
  std::binary_semaphore source_is_over{0};
  HookedSource source(lockstep.source, [&](int call) {
    if (call == 20) source_is_over.release();
  });
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  RecordingObserver observer;
  observer.on_frame = [&](const FrameOutcome& outcome) {
    if (outcome.result.frame_index == 0) source_is_over.acquire();
  };
  const SystemClock clock;
  RealTimeOptions options;
  options.rate = kFast;
  options.rt.enabled = false;
  options.max_unread = 4;
  const auto session = RunRealTime(source, *engine, clock, options, observer, test::kNeverStop);
  ASSERT_TRUE(session.ok()) << session.status().ToString();
  EXPECT_EQ(session->max_unread, 4u);
  // Frames 1 to 18 were answered while the first one was looked at.
  EXPECT_GE(session->num_frames_unread, 14u);
  ASSERT_EQ(observer.frames.size(), 20u);
  std::uint64_t num_dropped = 0;
  for (std::uint32_t i = 0; i < 20; ++i) {
    EXPECT_EQ(observer.frames[i].result.frame_index, i);
    num_dropped += observer.frames[i].is_dropped;
  }
  EXPECT_EQ(num_dropped, session->num_frames_unread);
}

TEST(RealTimeSession, DamagedFramesAreReportedInTheMiddleAndAtBothEnds) {
  ScriptedColon colon;
  colon.Damage("zero");
  colon.Occlude(1);
  colon.Damage("two");
  colon.Occlude(1);
  colon.Damage("four");
  colon.Damage("five");
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(colon.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 6u);
  for (std::uint32_t i = 0; i < 6; ++i) {
    EXPECT_EQ(observer.frames[i].result.frame_index, i);
    EXPECT_EQ(observer.frames[i].is_damaged, i != 1 && i != 3) << i;
  }
  EXPECT_EQ(observer.frames[4].result.timestamp, colon.TimeOf(4));
  EXPECT_EQ(observer.frames[5].result.timestamp, colon.TimeOf(5));
}

// More than the session's note pad holds, faster than anybody reads it.
TEST(RealTimeSession, LongDamageIsCountedFrameByFrame) {
  ScriptedColon colon;
  colon.Occlude(1);
  for (int i = 0; i < 1000; ++i) colon.Damage("broken");
  colon.Occlude(1);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(colon.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 1002u);
  int num_damaged = 0;
  for (const FrameOutcome& frame : observer.frames) num_damaged += frame.is_damaged;
  EXPECT_EQ(num_damaged, 1000);
}

// A camera that brings nothing whole any more.
TEST(RealTimeSession, DamagedFramesAreReportedWhileNoneIsAnswered) {
  constexpr int kNumDamaged = 600;
  for (const int num_before : {0, 1}) {
    ScriptedColon colon;
    if (num_before > 0) colon.Occlude(num_before);
    for (int i = 0; i < kNumDamaged; ++i) colon.Damage("broken");
    colon.Occlude(1);
    std::binary_semaphore all_are_told{0};
    bool were_told = false;
    HookedSource source(colon.source(), [&](int call) {
      if (call == num_before + kNumDamaged) were_told = all_are_told.try_acquire_for(std::chrono::seconds(20));
    });
    const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
    RecordingObserver observer;
    int num_told = 0;
    observer.on_frame = [&](const FrameOutcome& outcome) {
      if (outcome.is_damaged && ++num_told == kNumDamaged) all_are_told.release();
    };
    ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
    EXPECT_TRUE(were_told) << num_before;
    ASSERT_EQ(static_cast<int>(observer.frames.size()), num_before + kNumDamaged + 1);
    for (int i = 0; i < num_before + kNumDamaged; ++i) {
      EXPECT_EQ(observer.frames[i].result.frame_index, static_cast<std::uint32_t>(i));
      EXPECT_EQ(observer.frames[i].is_damaged, i >= num_before) << i;
      if (num_before > 0) {
        EXPECT_EQ(observer.frames[i].result.timestamp, colon.TimeOf(i)) << i;
      }
    }
  }
}

TEST(RealTimeSession, ErrorOfTheSourceEndsTheSessionWithItsStatus) {
  ScriptedColon colon;
  colon.Occlude(3);
  colon.Fail(StatusCode::kUnavailable, "grabber: cable pulled");
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  const auto session = RunRealTime(colon.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop);
  EXPECT_EQ(session.code(), StatusCode::kUnavailable);
  EXPECT_EQ(session.status().message(), "grabber: cable pulled");
  EXPECT_EQ(observer.frames.size(), 3u);
}

TEST(RealTimeSession, EmptySourceEndsAtOnce) {
  ScriptedColon colon;
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  const auto session = RunRealTime(colon.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop);
  ASSERT_TRUE(session.ok());
  EXPECT_EQ(session->video_time, Duration{0});
  EXPECT_TRUE(observer.calls.empty());
}

TEST(RealTimeSession, StopEndsTheSessionWithSuccess) {
  ScriptedColon colon;
  colon.Occlude(1000);
  std::atomic<bool> stop{false};
  HookedSource source(colon.source(), [&](int call) { stop = call == 7; });
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), kFast, observer, stop).ok());
  EXPECT_EQ(observer.frames.size(), 8u);
}

// The hook lets the driver go: a session that waits for capture first would never come to it.
TEST(RealTimeSession, MapsAreAtRestAfterAStopWhileADriverHoldsCapture) {
  struct Hooks final : SessionHooks {
    void OnMapsAtRest() override {
      ++num_rests;
      at_rest.release();
    }
    std::counting_semaphore<> at_rest{0};
    int num_rests = 0;
  } hooks;
  ScriptedColon colon;
  colon.Occlude(20);
  std::atomic<bool> stop{false};
  HookedSource source(colon.source(), [&](int call) {
    if (call != 7) return;
    stop = true;
    EXPECT_TRUE(hooks.at_rest.try_acquire_for(std::chrono::seconds(60)));
  });
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  RealTimeOptions options;
  options.rate = kFast;
  options.rt.enabled = false;
  options.hooks = &hooks;
  ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), options, observer, stop).ok());
  EXPECT_EQ(hooks.num_rests, 1);
  EXPECT_LE(observer.frames.size(), 7u) << "nobody was left to look at the frame that came then";
}

TEST(RealTimeSession, PaceOfZeroIsRefused) {
  ScriptedColon colon;
  colon.Occlude(1);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  const auto session = RunRealTime(colon.source(), *engine, SystemClock(), 0.0, observer, test::kNeverStop);
  EXPECT_EQ(session.code(), StatusCode::kInvalidArgument);
  EXPECT_TRUE(observer.calls.empty());
}

TEST(RealTimeSession, MappingThreadFoundsAMapThatTrackingAdopts) {
  ScriptedColon colon;
  colon.Move(0.0, 4.0, 100);
  Lockstep lockstep(colon);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  RecordingObserver observer;
  // An ordinary pace: the map has time to be made.
  constexpr double kRate = test::kIsSanitized ? 0.2 : 2.0;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, SystemClock(), kRate, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 100u);
  ASSERT_FALSE(observer.events.empty());
  EXPECT_EQ(observer.events[0].kind, MapEventKind::kMapCreated);
  int num_tracking = 0;
  for (const FrameOutcome& frame : observer.frames) num_tracking += frame.result.state == TrackingState::kTracking;
  EXPECT_GE(num_tracking, 20);
}

TEST(RealTimeSession, MergingThreadAnswersWhatMappingAsks) {
  ScriptedColon colon;
  colon.MoveAwayAndBack();
  Lockstep lockstep(colon);
  const SystemClock clock;
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device, &clock);
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, clock, 1.0, observer, test::kNeverStop).ok());
  int num_answers = 0, num_questions = 0;
  for (const MappingTimes& times : observer.mapped) {
    num_answers += times.recognition.count() > 0;
    num_questions += times.asking.count() > 0;
  }
  EXPECT_GT(num_answers, 0);
  EXPECT_GE(num_questions, num_answers);
  EXPECT_FALSE(engine->is_merging()) << "the last answer was taken";
}

// The stop comes when the maps have been joined: the seam would go on settling, and nobody waits for that.
TEST(RealTimeSession, StopLeavesTheSeamOfAJoinForTheNextSession) {
  struct Hooks final : SessionHooks {
    void BetweenMapSteps() override {
      const MapperCounters& counters = engine->mapper_counters();
      if (!stop && counters.merge_time.count() > 0 && !engine->is_merging()) {
        num_moves_at_stop = counters.num_reframings;
        stop = true;
      }
    }
    Engine* engine = nullptr;
    std::atomic<bool> stop{false};
    std::uint64_t num_moves_at_stop = 0;
  } hooks;
  ScriptedColon colon;
  // However slow the machine, the join comes to its end.
  colon.config().merging.max_milliseconds = 10000;
  colon.MoveAwayAndBack();
  Lockstep lockstep(colon);
  const SystemClock clock;
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device, &clock);
  hooks.engine = engine.get();
  RecordingObserver observer;
  RealTimeOptions options;
  options.rate = test::kIsSanitized ? 0.2 : 1.0;
  options.rt.enabled = false;
  options.hooks = &hooks;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, clock, options, observer, hooks.stop).ok());
  ASSERT_TRUE(hooks.stop) << "nothing was joined: the test shows nothing";
  EXPECT_EQ(std::count_if(observer.events.begin(), observer.events.end(),
                          [](const MapEvent& event) { return event.kind == MapEventKind::kMerged; }),
            1);
  EXPECT_EQ(engine->mapper_counters().settle_time.count(), 0);
  EXPECT_EQ(engine->mapper_counters().num_reframings, hooks.num_moves_at_stop);
  EXPECT_EQ(CheckInvariants(engine->atlas()).ToString(), "ok");
  EXPECT_FALSE(engine->MapStep(MapWork::kNeeded));
  EXPECT_TRUE(engine->MapStep()) << "nothing was left to settle: the test shows nothing";
}

// A camera that never brings a frame but respects the deadline.
class SilentSource final : public FrameSource {
 public:
  explicit SilentSource(FrameSource& source) : source_(source) {}
  const CameraCalibration& calibration() const override { return source_.calibration(); }
  std::uint32_t num_frames() const override { return 0; }
  ImageView static_mask() const override { return source_.static_mask(); }
  Result<Frame> Next(TimePoint deadline) override {
    while (SystemClock().Now() < deadline) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Status(StatusCode::kDeadlineExceeded);
  }

 private:
  FrameSource& source_;
};

// A camera whose frames take their time to arrive, and bear the stamp of when they were taken.
class LiveSource final : public FrameSource {
 public:
  LiveSource(FrameSource& source, std::vector<TimePoint>* stamps) : source_(source), stamps_(stamps) {}
  const CameraCalibration& calibration() const override { return source_.calibration(); }
  std::uint32_t num_frames() const override { return 0; }
  bool is_live() const override { return true; }
  ImageView static_mask() const override { return source_.static_mask(); }
  Result<Frame> Next(TimePoint deadline) override {
    Result<Frame> frame = source_.Next(deadline);
    if (!frame.ok()) return frame;
    frame->timestamp = SystemClock().Now();
    std::this_thread::sleep_for(kTransport);
    stamps_->push_back(frame->timestamp);
    return frame;
  }

  static constexpr Duration kTransport = std::chrono::milliseconds(30);

 private:
  FrameSource& source_;
  std::vector<TimePoint>* stamps_;
};

// Who watches the capture thread sees that it lives.
TEST(RealTimeSession, CaptureShowsThatItLivesWhileAFrameIsNotDue) {
  ScriptedColon colon;
  colon.SetPeriod(std::chrono::seconds(1));
  colon.Occlude(2);
  Heartbeat heartbeat;
  std::vector<std::uint64_t> beats;  // before each call of Next
  HookedSource source(colon.source(), [&](int) { beats.push_back(heartbeat.count()); });
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  RealTimeOptions options;
  options.capture_heartbeat = &heartbeat;
  ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), options, observer, test::kNeverStop).ok());
  ASSERT_EQ(beats.size(), 3u);
  EXPECT_EQ(beats[1], beats[0]) << "the first frame is due at once";
  EXPECT_GE(beats[2], beats[1] + 2) << "the second one a second later";
  EXPECT_GT(heartbeat.last(), TimePoint{});
}

TEST(RealTimeSession, LatencyOfALiveCameraCountsFromItsStamps) {
  ScriptedColon colon;
  colon.config().scheduler.deadline_ms = 20;
  colon.Occlude(5);
  std::vector<TimePoint> stamps;
  LiveSource source(colon.source(), &stamps);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  // A camera waits for no pace.
  ASSERT_TRUE(RunRealTime(source, *engine, SystemClock(), 0.5, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 5u);
  for (const FrameOutcome& frame : observer.frames) {
    if (frame.is_dropped) continue;
    EXPECT_EQ(frame.due, stamps[frame.result.frame_index]);
    EXPECT_EQ(frame.capture_begin, frame.due);
    EXPECT_GE(frame.capture, LiveSource::kTransport);
    EXPECT_GE(frame.latency, LiveSource::kTransport);
    EXPECT_TRUE(frame.is_late);
  }
}

TEST(RealTimeSession, HeartBeatsWithoutFramesAndStopEndsASilentCamera) {
  ScriptedColon colon;
  SilentSource source(colon.source());
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RecordingObserver observer;
  Heartbeat heartbeat;
  RealTimeOptions options;
  options.rt.enabled = false;
  options.heartbeat = &heartbeat;
  std::atomic<bool> stop{false};
  Result<SessionSummary> session = SessionSummary();
  std::thread thread([&] { session = RunRealTime(source, *engine, SystemClock(), options, observer, stop); });
  while (heartbeat.count() < 5) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  stop = true;
  thread.join();
  EXPECT_TRUE(session.ok());
  EXPECT_TRUE(observer.frames.empty());
}

TEST(RealTimeSession, StartsAndStopsAgainAndAgain) {
  ScriptedColon colon;
  colon.Move(0.0, 6.0, 300);
  colon.Occlude(2000);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  const SystemClock clock;
  Duration longest{0};
  for (int i = 0; i < 20; ++i) {
    RecordingObserver observer;
    std::atomic<bool> stop{false};
    TimePoint asked;
    std::thread stopper([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(i));  // anywhere in its life, the start included
      asked = clock.Now();
      stop = true;
    });
    const auto session = RunRealTime(colon.source(), *engine, clock, 5.0, observer, stop);
    stopper.join();
    ASSERT_TRUE(session.ok()) << session.status().ToString();
    longest = std::max(longest, clock.Now() - asked);
  }
  RecordProperty("longest_stop_ms", std::to_string(ToMilliseconds(longest)));
}

TEST(RealTimeSession, NoFrameOfAnEarlierSessionIsMarked) {
  ScriptedColon colon;
  colon.Move(0.0, 2.4, 60);
  Lockstep lockstep(colon);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  const auto mark = [&](std::uint32_t frame_index) {
    return engine->SetMark({frame_index, {200.0, 150.0}, MarkLabel::From("polyp").value()}).code();
  };
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  EXPECT_EQ(mark(0), StatusCode::kFailedPrecondition) << "it has no pose";
  ScriptedColon empty;
  ASSERT_TRUE(RunRealTime(empty.source(), *engine, SystemClock(), kFast, observer, test::kNeverStop).ok());
  EXPECT_EQ(mark(0), StatusCode::kNotFound);
  EXPECT_EQ(mark(kNewestFrame), StatusCode::kNotFound);
}

// Depth is searched beside all else, at the camera's own pace. What a session leaves unsearched is done afterwards, and
// nothing is lost between.
TEST(RealTimeSession, DepthOfKeyframesIsSearchedOnItsOwnThread) {
  const EngineConfig config = test::QuickDepthConfig();
  ScriptedColon colon(TimePoint{}, config);
  colon.Move(0.0, 3.0, 100);
  DepthMatcher depth(colon.camera(), ImageView{}, config.depth.options());
  const SystemClock clock;
  Engine engine(config, colon.camera(), colon.device(), Engine::Mode::kRealTime, &clock, ImageView{}, nullptr, &depth);
  RecordingObserver observer;
  ASSERT_TRUE(
      RunRealTime(colon.source(), engine, clock, test::kIsSanitized ? 0.4 : 1.0, observer, test::kNeverStop).ok());
  engine.FinishDepth(test::kNeverStop);
  const DepthCounters& counters = engine.depths()->counters();
  EXPECT_GT(counters.num_pictures, 2u);
  EXPECT_GT(counters.num_depths, 0u);
  EXPECT_EQ(counters.num_searches, counters.num_depths + counters.num_in_vain);
  EXPECT_FALSE(engine.has_depth_work());
}

// Grants nothing.
class RefusingSystem : public ThreadSystem {
 public:
  int SetFifo(int) override { return EPERM; }
  int SetCpus(const CpuList&) override { return EINVAL; }
  int SetNice(int) override { return EPERM; }
  int LockMemory(bool) override { return ENOMEM; }
  void UnlockMemory() override {}
  int HoldHeap(std::size_t) override { return 0; }
  void ReleaseHeap() override {}
  std::size_t HeapBytes() const override { return 0; }
  int FifoPriority() const override { return 0; }
  CpuList Cpus() const override { return CpuList(1); }
  bool MayLockAll() const override { return false; }
  std::int64_t PriorityLimit() const override { return 0; }
  std::int64_t LockLimitBytes() const override { return 0; }
  std::string KernelPreemption() const override { return {}; }
  double RealTimeShare() const override { return 1.0; }
};

// Three frames that show nothing.
Result<SessionSummary> RunShortlyOn(ThreadSystem& system, bool is_required, RecordingObserver& observer) {
  ScriptedColon colon;
  colon.Occlude(3);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, colon.device());
  RealTimeOptions options;
  options.rate = kFast;
  options.rt.require = is_required;
  options.system = &system;
  return RunRealTime(colon.source(), *engine, SystemClock(), options, observer, test::kNeverStop);
}

TEST(RealTimeSession, MissingPrivilegeIsFatalOnlyWhenRequired) {
  for (const bool is_required : {false, true}) {
    RecordingObserver observer;
    RefusingSystem system;
    const auto session = RunShortlyOn(system, is_required, observer);
    EXPECT_EQ(session.code(), is_required ? StatusCode::kFailedPrecondition : StatusCode::kOk);
    EXPECT_EQ(observer.frames.size(), is_required ? 0u : 3u);
    EXPECT_EQ(observer.reports.size(), is_required ? 0u : 1u);
    if (!is_required) {
      EXPECT_EQ(Refusals(observer.reports[0]).size(), 3u);  // two priorities, memory
    }
  }
}

// The heap is larger each time that somebody asks.
class GrowingSystem final : public RefusingSystem {
 public:
  std::size_t HeapBytes() const override { return num_bytes_ += 1'500'000; }

 private:
  mutable std::size_t num_bytes_ = 0;
};

TEST(RealTimeSession, HeapThatGrowsBeyondWhatWasSetAsideIsToldInTheSummary) {
  RecordingObserver observer;
  GrowingSystem system;
  const auto session = RunShortlyOn(system, false, observer);
  ASSERT_TRUE(session.ok());
  EXPECT_EQ(session->heap_growth_bytes, 1'500'000u);
}

TEST(RealTimeSession, LateFramesAreCountedAgainstTheDeadline) {
  for (const double deadline_ms : {0.000001, 1000.0}) {
    ScriptedColon colon;
    colon.config().scheduler.deadline_ms = deadline_ms;
    colon.Occlude(5);
    Lockstep lockstep(colon);
    const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
    RecordingObserver observer;
    ASSERT_TRUE(RunRealTime(lockstep.source, *engine, SystemClock(), 2.0, observer, test::kNeverStop).ok());
    ASSERT_EQ(observer.frames.size(), 5u);
    for (const FrameOutcome& frame : observer.frames) {
      EXPECT_EQ(frame.is_late, frame.latency > frame.deadline - frame.due);
      EXPECT_TRUE(frame.is_late || deadline_ms > 1);
    }
  }
}

// The camera of the colon states no rate, for which 25 Hz are taken.
TEST(RealTimeSession, AFrameOfARecordingHasAsLongAsUntilTheNextOne) {
  ScriptedColon colon;
  colon.SetPeriod(std::chrono::milliseconds(160));
  colon.Occlude(4);
  Lockstep lockstep(colon);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, SystemClock(), 2.0, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 4u);
  for (std::size_t i = 1; i < observer.frames.size(); ++i) {
    EXPECT_EQ(observer.frames[i].deadline - observer.frames[i].due, std::chrono::milliseconds(80)) << i;
  }
}

TEST(RealTimeSession, AFrameAfterAPauseOfARecordingHasNoLongerThanTheOthers) {
  ScriptedColon colon;
  ScriptedFrameSource frames(colon.camera().calibration());
  for (const int stamp_ms : {0, 40, 80, 5080, 5120}) frames.AddFrame(TimePoint(std::chrono::milliseconds(stamp_ms)));
  Lockstep lockstep(colon, frames);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, lockstep.device);
  RecordingObserver observer;
  ASSERT_TRUE(RunRealTime(lockstep.source, *engine, SystemClock(), 4.0, observer, test::kNeverStop).ok());
  ASSERT_EQ(observer.frames.size(), 5u);
  for (const FrameOutcome& frame : observer.frames) {
    EXPECT_EQ(frame.deadline - frame.due, std::chrono::milliseconds(10)) << frame.result.frame_index;
  }
}

}  // namespace
}  // namespace haustra
