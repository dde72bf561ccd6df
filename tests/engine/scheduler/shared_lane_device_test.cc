// Two threads on one lane: a device that notices whether it ever has two users.
#include "engine/scheduler/shared_lane_device.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>

#include "hal/fakes/scripted_vision_device.h"

namespace haustra {
namespace {

class OneUserDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest&) override {
    EXPECT_EQ(lane, Lane::kBackground);
    if (fails_next.exchange(false)) return Status(StatusCode::kUnavailable);
    const std::thread::id nobody, me = std::this_thread::get_id();
    std::thread::id user = user_.load();
    if (user == nobody) user_.store(me);
    num_intruders += user != nobody && user != me;
    ++num_under_way_;
    return Ticket{++num_requests_};
  }
  Status Wait(Ticket, TimePoint deadline) override {
    std::this_thread::yield();
    if (deadline != kNoDeadline) return Status(StatusCode::kDeadlineExceeded);
    num_intruders += user_.load() != std::this_thread::get_id();
    if (--num_under_way_ == 0) user_.store(std::thread::id());
    return Status::Ok();
  }

  std::atomic<int> num_intruders{0};
  std::atomic<bool> fails_next{false};

 private:
  std::atomic<std::thread::id> user_{};
  std::atomic<int> num_under_way_{0};
  std::atomic<std::uint64_t> num_requests_{0};
};

TEST(SharedLaneDevice, LaneHasOneUserUntilItsLastRequestHasBeenWaitedFor) {
  ScriptedVisionDevice scripted(VisionPlan{}, {});
  OneUserDevice device(scripted);
  SharedLaneDevice shared(device);
  const auto use = [&shared] {
    for (int i = 0; i < 2000; ++i) {
      std::array<Ticket, 4> tickets;
      for (Ticket& ticket : tickets) ticket = shared.EnqueueMatch(Lane::kBackground, {}).value();
      // A wait that ends too early leaves the lane taken.
      if (i % 100 == 0) {
        EXPECT_EQ(shared.Wait(tickets[0], TimePoint{}).code(), StatusCode::kDeadlineExceeded);
      }
      for (const Ticket ticket : tickets) EXPECT_TRUE(shared.Wait(ticket, kNoDeadline).ok());
    }
  };
  std::thread other(use);
  use();
  other.join();
  EXPECT_EQ(device.num_intruders, 0);
}

TEST(SharedLaneDevice, RefusedRequestLeavesTheLaneFree) {
  ScriptedVisionDevice scripted(VisionPlan{}, {});
  OneUserDevice device(scripted);
  SharedLaneDevice shared(device);
  device.fails_next = true;
  EXPECT_EQ(shared.EnqueueMatch(Lane::kBackground, {}).code(), StatusCode::kUnavailable);
  std::thread([&] { EXPECT_TRUE(MatchAndWait(shared, Lane::kBackground, {}).ok()); }).join();
}

}  // namespace
}  // namespace haustra
