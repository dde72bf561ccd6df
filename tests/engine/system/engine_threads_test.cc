// The engine on three threads at once, as a real-time session has it, for the thread sanitizer: a map, a loss, another
// map, and the way back on which they are joined. The threads pace each other by relaxed atomics alone, which order
// nothing: what the engine does not order itself is seen as a race.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

#include "engine/atlas/invariants.h"
#include "platform/clock/system_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

// Every so many frames one follows the last at once; the others wait until the mapper has nothing to do.
constexpr std::size_t kHurry = 3;

class EngineThreads {
 public:
  explicit EngineThreads(ScriptedColon& colon)
      : colon_(colon), engine_(colon.MakeEngine(Engine::Mode::kRealTime, colon.device(), &clock_)) {}

  void Run() {
    std::thread merging([this] {
      while (!Get(stop_merging_)) {
        if (!engine_->MergeStep()) std::this_thread::yield();
      }
    });
    std::thread mapping([this] { MapLoop(); });
    std::thread tracking([this] { TrackLoop(); });
    // What the service shows while all goes on.
    while (!Get(is_over_)) {
      num_keyframes_seen = std::max(num_keyframes_seen, engine_->pool_use().keyframes);
      num_sets_refused = engine_->num_feature_sets_refused();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    tracking.join();
    mapping.join();
    merging.join();
  }

  Engine& engine() { return *engine_; }
  int NumEvents(MapEventKind kind) const {
    return static_cast<int>(
        std::count_if(events.begin(), events.end(), [kind](const MapEvent& event) { return event.kind == kind; }));
  }

  std::vector<FrameResult> results;
  std::vector<MapEvent> events;
  std::uint32_t num_keyframes_seen = 0;
  std::uint64_t num_sets_refused = 0;

 private:
  static bool Get(const std::atomic<bool>& flag) { return flag.load(std::memory_order_relaxed); }

  void TrackLoop() {
    for (Result<Frame> frame = colon_.source().Next(kNoDeadline); frame.ok();
         frame = colon_.source().Next(kNoDeadline)) {
      results.push_back(engine_->Track(*frame, kNoDeadline));
      const std::uint64_t idle = num_idle_.load(std::memory_order_relaxed);
      // Twice: the mapper may have looked before the proposal was there.
      while (results.size() % kHurry != 0 && num_idle_.load(std::memory_order_relaxed) < idle + 2) {
        std::this_thread::yield();
      }
    }
    stop_mapping_.store(true, std::memory_order_relaxed);
  }

  void MapLoop() {
    while (true) {
      const bool is_stopping = Get(stop_mapping_);
      const bool is_busy = engine_->MapStep() || engine_->is_merging();
      for (MapEvent event; engine_->map_events().TryPop(&event);) events.push_back(event);
      for (LatePose pose; engine_->late_poses().TryPop(&pose);) continue;
      if (is_busy) continue;
      if (is_stopping) break;
      num_idle_.fetch_add(1, std::memory_order_relaxed);
      std::this_thread::yield();
    }
    stop_merging_.store(true, std::memory_order_relaxed);
    is_over_.store(true, std::memory_order_relaxed);
  }

  ScriptedColon& colon_;
  SystemClock clock_;
  std::unique_ptr<Engine> engine_;
  std::atomic<std::uint64_t> num_idle_{0};  // times that the mapper had nothing to do
  std::atomic<bool> stop_mapping_{false};
  std::atomic<bool> stop_merging_{false};
  std::atomic<bool> is_over_{false};
};

TEST(EngineThreads, MapsLossesAndAJoinAtOnce) {
  ScriptedColon colon;
  // However slow the machine, solvers and joins come to their end.
  colon.config().mapping.max_bundle_ms = 100000;
  colon.config().merging.max_milliseconds = 100000;
  colon.Move(0.0, 4.0, 80);
  colon.Occlude(5);
  colon.Move(9.0, 3.0, 120);
  EngineThreads threads(colon);
  threads.Run();
  EXPECT_EQ(CheckInvariants(threads.engine().atlas()).ToString(), "ok");
  EXPECT_EQ(threads.NumEvents(MapEventKind::kMapCreated), 2);
  EXPECT_EQ(threads.NumEvents(MapEventKind::kMerged), 1);
  ASSERT_EQ(threads.results.size(), colon.centres().size());
  EXPECT_EQ(threads.results.back().state, TrackingState::kTracking);
  EXPECT_GE(threads.num_keyframes_seen, 10u);
  EXPECT_EQ(threads.num_sets_refused, 0u);
}

}  // namespace
}  // namespace haustra::test
