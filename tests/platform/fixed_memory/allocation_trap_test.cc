// That the trap catches what it should, and that tracking gives it nothing to catch.
#include "platform/trap/allocation_trap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "platform/assemble.h"
#include "platform/clock/system_clock.h"
#include "platform/session/session.h"
#include "platform/session/warm_up.h"
#include "tests/tools/run/recording_observer.h"
#include "tests/tools/run/scripted_colon.h"
#include "tests/tools/run/small_vision_plan.h"

namespace haustra {
namespace {

// Through a volatile pointer, so that the compiler cannot leave out what is never used.
void* volatile block = nullptr;

TEST(AllocationTrap, CountsEveryCallOfTheFamilyOnItsThread) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  const AllocationTrap trap(AllocationTrap::Mode::kCount);
  EXPECT_EQ(trap.count(), 0u);
  block = std::malloc(10);
  block = std::realloc(block, 1000);
  std::free(block);
  EXPECT_EQ(trap.count(), 3u);
  block = std::calloc(2, 8);
  std::free(block);
  block = std::aligned_alloc(64, 128);
  std::free(block);
  EXPECT_EQ(trap.count(), 7u);
  block = ::operator new(16);
  ::operator delete(block);
  EXPECT_EQ(trap.count(), 9u);
  std::free(nullptr);
  EXPECT_EQ(trap.count(), 9u);
}

TEST(AllocationTrap, OtherThreadsAndTheTimeAfterAreFree) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  std::atomic<int> stage{0};
  std::thread other([&] {
    while (stage.load() == 0) std::this_thread::yield();
    void* volatile mine = std::malloc(100);
    std::free(mine);
    stage = 2;
  });
  {
    const AllocationTrap outer(AllocationTrap::Mode::kAbort);
    stage = 1;
    while (stage.load() != 2) std::this_thread::yield();
    {
      const AllocationTrap inner(AllocationTrap::Mode::kCount);
      block = std::malloc(1);
      std::free(block);
      EXPECT_EQ(inner.count(), 2u);
    }
    EXPECT_EQ(outer.count(), 0u);
  }
  other.join();
  block = std::malloc(1);
  std::free(block);
}

TEST(AllocationTrapDeathTest, AbortNamesTheCall) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto allocate = [] {
    const AllocationTrap trap(AllocationTrap::Mode::kAbort);
    block = std::malloc(10);
  };
  EXPECT_DEATH(allocate(), "allocation trap: malloc on a thread that must not use the heap");
  const auto give_back = [] {
    block = std::malloc(10);
    const AllocationTrap trap(AllocationTrap::Mode::kAbort);
    std::free(block);
  };
  EXPECT_DEATH(give_back(), "allocation trap: free on a thread");
}

// Losses, relocalisations, new maps and merges, and an end in the dark.
void ManyLosses(test::ScriptedColon* colon) {
  colon->Move(0.0, 2.0, 55);
  colon->Occlude(6);
  colon->Move(1.9, 2.5, 20);
  colon->Occlude(6);
  colon->Move(7.0, 8.0, 35);
  colon->Occlude(6);
  colon->Move(2.4, 8.2, 125);
  colon->Occlude(3);
}

class Watched final : public test::RecordingObserver {
 public:
  explicit Watched(const ThreadWatch& watch) : watch_(watch) {}
  const ThreadWatch* thread_watch() const override { return &watch_; }

 private:
  const ThreadWatch& watch_;
};

TEST(AllocationTrap, TrackingThroughLossesAndMergesLeavesTheHeapAlone) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  for (const bool is_realtime : {false, true}) {
    test::ScriptedColon colon;
    ManyLosses(&colon);
    const auto engine =
        colon.MakeEngine(is_realtime ? Engine::Mode::kRealTime : Engine::Mode::kSequential, colon.device());
    Watched observer(CountingHeapWatch());
    const SystemClock clock;
    const std::atomic<bool> never{false};
    const auto session = is_realtime ? RunRealTime(colon.source(), *engine, clock, 50.0, observer, never)
                                     : RunSequential(colon.source(), *engine, clock, observer, never);
    ASSERT_TRUE(session.ok());
    int num_tracked = 0;
    for (const FrameOutcome& frame : observer.frames) {
      EXPECT_EQ(frame.use.trapped_calls, 0u)
          << "frame " << frame.result.frame_index << ' ' << ToString(frame.result.reason);
      num_tracked += frame.result.state == TrackingState::kTracking;
    }
    if (is_realtime) continue;
    EXPECT_GT(num_tracked, 150);
    const auto count = [&](MapEventKind kind) {
      return std::count_if(observer.events.begin(), observer.events.end(),
                           [kind](const MapEvent& event) { return event.kind == kind; });
    };
    EXPECT_GE(count(MapEventKind::kMapCreated), 2);
    EXPECT_GE(count(MapEventKind::kMerged), 1);
  }
}

// Whatever a runtime allocates at the first call of a kind, or of a thread, is taken before a session begins.
void ExpectNoHeapAfterWarmUp(const char* name) {
  const Result<std::unique_ptr<VisionDevice>> device =
      CreateVisionDevice(name, test::SmallVisionPlan(), {.num_features = 300}, 1);
  if (device.code() == StatusCode::kUnavailable) GTEST_SKIP() << device.status().message();
  ASSERT_TRUE(device.ok()) << device.status().ToString();
  ASSERT_TRUE(WarmUp(**device, 320, 240, PixelFormat::kGrey8).ok());

  std::vector<std::uint8_t> pixels(320 * 240);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<std::uint8_t>((i / 320 / 8 * 31 + i % 320 / 8 * 57) % 200);
  }
  std::vector<Keypoint> keypoints(500), known;
  std::vector<FollowedPoint> followed(500);
  std::vector<Match> matches(500);
  const std::vector<std::array<float, 3>> bearings(500, {0.0f, 0.0f, 1.0f});
  const std::vector<float> tolerances(500, 1.0f);
  const EpipolarGate gate = {{0, 0, 0, 0, 0, -1, 0, 1, 0}, bearings, bearings, tolerances, tolerances};
  known.reserve(500);
  std::uint32_t num_calls = 0;
  int num_features = 0;
  std::thread tracking([&] {
    ASSERT_TRUE((*device)->ServeThisThread(Lane::kTracking).ok());
    const AllocationTrap trap(AllocationTrap::Mode::kCount);
    for (int i = 0; i < 2; ++i) {
      const Result<FeatureSetHandle> set = (*device)->CreateFeatureSet();
      ASSERT_TRUE(set.ok());
      std::int32_t num = 0, num_matches = 0;
      ExtractRequest extract;
      extract.image = {pixels.data(), 320, 240, 320, PixelFormat::kGrey8};
      extract.set = *set;
      extract.keypoints = keypoints;
      extract.num_keypoints = &num;
      extract.follow = known;
      extract.followed_to = std::span(followed).first(known.size());
      ASSERT_TRUE(ExtractAndWait(**device, Lane::kTracking, extract).ok());
      known.assign(keypoints.begin(), keypoints.begin() + num);
      num_features = num;
      MatchRequest match;
      match.query = match.train = DescriptorList::Whole(*set);
      match.matches = matches;
      match.num_matches = &num_matches;
      match.epipolar = i == 0 ? nullptr : &gate;
      ASSERT_TRUE(MatchAndWait(**device, Lane::kTracking, match).ok());
      const GuidedQuery query = {{*set, 0}, keypoints[0].x_px, keypoints[0].y_px, 20.0f, 0.1f, 100.0f};
      GuidedMatchRequest guided;
      guided.queries = {&query, 1};
      guided.train = *set;
      guided.matches = matches;
      guided.num_matches = &num_matches;
      ASSERT_TRUE(GuidedMatchAndWait(**device, Lane::kTracking, guided).ok());
      EXPECT_EQ(num_matches, 1);
      (*device)->ReleaseFeatureSet(*set);
    }
    num_calls = trap.count();
  });
  tracking.join();
  EXPECT_GT(num_features, 50);
  EXPECT_EQ(num_calls, 0u);
}

TEST(AllocationTrap, FirstFrameOfACpuDeviceLeavesTheHeapAlone) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  ExpectNoHeapAfterWarmUp("cpu");
}

TEST(AllocationTrap, FirstFrameOfACudaDeviceLeavesTheHeapAlone) {
  if (!AllocationTrap::IsAvailable()) GTEST_SKIP() << "malloc cannot be watched in this build";
  ExpectNoHeapAfterWarmUp("cuda");
}

}  // namespace
}  // namespace haustra
