// A real-time session whose vision device is lost or never answers; no time is asserted.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <memory>
#include <thread>

#include "hal/fakes/manual_clock.h"
#include "hal/fakes/timed_vision_device.h"
#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "platform/session/watched_vision_device.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using test::RecordingObserver;
using test::ScriptedColon;

// Answers nothing from its first extraction on, until it is let go.
class HungDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;
  bool is_accelerator() const override { return true; }

  Status Wait(Ticket ticket, TimePoint deadline) override {
    while (is_hung_) {
      ++num_looks_;
      if (SystemClock().Now() >= deadline) return Status(StatusCode::kDeadlineExceeded);
      std::this_thread::sleep_for(milliseconds(1));
    }
    return ForwardingVisionDevice::Wait(ticket, deadline);
  }
  void LetGo() { is_hung_ = false; }
  int num_looks() const { return num_looks_; }

 private:
  std::atomic<bool> is_hung_{true};
  std::atomic<int> num_looks_{0};
};

TEST(HungDevice, KeepsTheHeartFromBeating) {
  RecordProperty("req", "DMN-002");
  ScriptedColon colon;
  colon.config().scheduler.deadline_ms = 1;
  colon.Occlude(3);
  HungDevice device(colon.device());
  const SystemClock clock;
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, device, &clock);
  RecordingObserver observer;
  Heartbeat heartbeat;
  RealTimeOptions options;
  options.rt.enabled = false;
  options.heartbeat = &heartbeat;
  std::thread session(
      [&] { EXPECT_TRUE(RunRealTime(colon.source(), *engine, clock, options, observer, test::kNeverStop).ok()); });
  // The frame is answered at its deadline without a measurement; from then on tracking waits for its picture.
  while (device.num_looks() < 50) std::this_thread::sleep_for(milliseconds(1));
  const std::uint64_t before = heartbeat.count();
  const int looks_before = device.num_looks();
  while (device.num_looks() < looks_before + 100) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(heartbeat.count(), before);
  device.LetGo();
  session.join();
  EXPECT_GT(heartbeat.count(), before);
}

using Fault = WatchedVisionDevice::Fault;
constexpr Duration kPatience = milliseconds(50);

// A request of the tracking lane that finds nothing.
struct SmallRequest {
  explicit SmallRequest(VisionDevice& device) : set(*device.CreateFeatureSet()) {
    request.train = set;
    request.matches = matches;
    request.num_matches = &num_matches;
  }
  Result<Ticket> Enqueue(VisionDevice& device) const { return device.EnqueueGuidedMatch(Lane::kTracking, request); }

  FeatureSetHandle set;
  std::array<Match, 1> matches;
  std::int32_t num_matches = 0;
  GuidedMatchRequest request;
};

TEST(WatchedVisionDevice, HangsWhenAnAnswerDoesNotComeInTimeAndIsLeftAloneFromThenOn) {
  ScriptedColon colon;
  HungDevice hung(colon.device());
  const SystemClock clock;
  WatchedVisionDevice device(hung, clock, kPatience);
  const SmallRequest small(device);
  const Result<Ticket> ticket = small.Enqueue(device);
  ASSERT_TRUE(ticket.ok());
  EXPECT_EQ(device.Wait(*ticket, clock.Now()).code(), StatusCode::kDeadlineExceeded);
  EXPECT_EQ(device.fault(), Fault::kNone) << "a deadline is no fault";
  EXPECT_EQ(device.Wait(*ticket, kNoDeadline).code(), StatusCode::kUnavailable);
  EXPECT_EQ(device.fault(), Fault::kHung);
  const int num_looks = hung.num_looks();
  EXPECT_EQ(device.Wait(*ticket, kNoDeadline).code(), StatusCode::kUnavailable);
  EXPECT_EQ(small.Enqueue(device).code(), StatusCode::kUnavailable);
  EXPECT_EQ(device.ReadDescriptors(small.set, {}).code(), StatusCode::kUnavailable);
  EXPECT_EQ(hung.num_looks(), num_looks);
}

// No accelerator: it works on the thread that waits, however long that takes.
TEST(WatchedVisionDevice, ThatWorksInsideOfTheWaitDoesNotHang) {
  ScriptedColon colon;
  ManualClock clock;
  TimedVisionDevice slow(colon.device(), clock, [&](TimePoint time) { clock.AdvanceTo(time); });
  slow.SetModel({.guided = 10 * kPatience});
  WatchedVisionDevice device(slow, clock, kPatience);
  const SmallRequest small(device);
  const Result<Ticket> ticket = small.Enqueue(device);
  ASSERT_TRUE(ticket.ok());
  EXPECT_TRUE(device.Wait(*ticket, kNoDeadline).ok());
  EXPECT_EQ(device.fault(), Fault::kNone);
}

TEST(WatchedVisionDevice, IsLostWithTheFirstAnswerThatSaysSo) {
  ScriptedColon colon;
  const SystemClock clock;
  WatchedVisionDevice device(colon.device(), clock, kPatience);
  const SmallRequest small(device);
  const Result<Ticket> ticket = small.Enqueue(device);
  ASSERT_TRUE(ticket.ok());
  EXPECT_TRUE(device.Wait(*ticket, kNoDeadline).ok());
  colon.device().SetLost(true);
  EXPECT_EQ(small.Enqueue(device).code(), StatusCode::kUnavailable);
  EXPECT_EQ(device.fault(), Fault::kLost);
  // What was on it is gone, whether it comes back or not.
  colon.device().SetLost(false);
  EXPECT_EQ(small.Enqueue(device).code(), StatusCode::kUnavailable);
}

// Frames without end, whatever the device does with them.
Result<SessionSummary> RunOnWatched(ScriptedColon& colon, VisionDevice& inner, RecordingObserver& observer) {
  const SystemClock clock;
  WatchedVisionDevice device(inner, clock, kPatience);
  const auto engine = colon.MakeEngine(Engine::Mode::kRealTime, device, &clock);
  RealTimeOptions options;
  options.rt.enabled = false;
  options.device = &device;
  return RunRealTime(colon.source(), *engine, clock, options, observer, test::kNeverStop);
}

TEST(WatchedVisionDevice, ThatHangsEndsTheSession) {
  RecordProperty("req", "DMN-010");
  ScriptedColon colon;
  colon.Occlude(100000);
  HungDevice hung(colon.device());
  RecordingObserver observer;
  const auto session = RunOnWatched(colon, hung, observer);
  EXPECT_EQ(session.code(), StatusCode::kUnavailable);
  EXPECT_EQ(session.status().message(), "the vision device hangs");
  hung.LetGo();
}

TEST(WatchedVisionDevice, ThatIsLostEndsTheSession) {
  RecordProperty("req", "DMN-010");
  ScriptedColon colon;
  colon.Move(0.0, 4.0, 100);
  colon.Occlude(100000);
  RecordingObserver observer;
  observer.on_frame = [&](const FrameOutcome& outcome) {
    if (outcome.result.frame_index == 30) colon.device().SetLost(true);
  };
  const auto session = RunOnWatched(colon, colon.device(), observer);
  EXPECT_EQ(session.code(), StatusCode::kUnavailable);
  EXPECT_EQ(session.status().message(), "the vision device is lost");
}

}  // namespace
}  // namespace haustra
