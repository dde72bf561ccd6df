// A real-time session whose vision device is lost or never answers; no time is asserted.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>

#include "hal/forwarding_vision_device.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
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

}  // namespace
}  // namespace haustra
