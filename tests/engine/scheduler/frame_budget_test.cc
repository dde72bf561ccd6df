// The policy of the ladder on a clock that the test moves: the same times, the same answers.
#include "engine/scheduler/frame_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "engine/geometry/rng.h"
#include "hal/fakes/manual_clock.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

constexpr Duration kPeriodOfBudget = milliseconds(40);
constexpr Duration kRetryAfter = milliseconds(1000);

TEST(StageExpectation, IsTheNearestRankOfTheLastDurations) {
  Rng rng(5);
  std::vector<Duration> all;
  StageExpectation quantile(0.98, kRetryAfter);
  for (int i = 0; i < 300; ++i) {
    all.push_back(Duration(static_cast<std::int64_t>(rng.Uniform(1.0, 1e6))));
    quantile.Add(all.back());
    std::vector<Duration> last(all.end() - std::min<std::size_t>(all.size(), StageExpectation::kWindow), all.end());
    std::sort(last.begin(), last.end());
    // Of 64 the second largest, of up to 49 the largest.
    const std::size_t rank = static_cast<std::size_t>(std::ceil(0.98 * static_cast<double>(last.size())));
    ASSERT_EQ(quantile.value(), last[rank - 1]) << i;
  }
}

TEST(StageExpectation, OneOutlierChangesNothingTwoDo) {
  StageExpectation quantile(0.98, kRetryAfter);
  for (int i = 0; i < 64; ++i) quantile.Add(milliseconds(10));
  quantile.Add(milliseconds(90));
  EXPECT_EQ(quantile.value(), milliseconds(10));
  quantile.Add(milliseconds(80));
  EXPECT_EQ(quantile.value(), milliseconds(80));
}

TEST(StageExpectation, IsForgottenAfterRefusalsAndThenBelievesTheNextDuration) {
  StageExpectation expectation(0.98, kRetryAfter);
  for (int i = 0; i < 64; ++i) expectation.Add(milliseconds(100));
  for (int i = 0; i < 25; ++i) {
    EXPECT_EQ(expectation.value(), milliseconds(100)) << i;
    expectation.Refused(kPeriodOfBudget);
  }
  EXPECT_EQ(expectation.value(), Duration{0});
  expectation.Add(milliseconds(7));
  EXPECT_EQ(expectation.value(), milliseconds(7));
}

TEST(StageExpectation, PatienceDoublesWhileItIsAsSlow) {
  StageExpectation expectation(0.98, kRetryAfter);
  expectation.Add(milliseconds(100));
  for (const int patience : {25, 50, 100, 200, 400, 400}) {
    for (int i = 0; i < patience; ++i) {
      ASSERT_EQ(expectation.value(), milliseconds(100)) << patience << " " << i;
      expectation.Refused(kPeriodOfBudget);
    }
    ASSERT_EQ(expectation.value(), Duration{0}) << patience;
    expectation.Add(milliseconds(100));
  }
}

TEST(StageExpectation, OneRefusalForgetsNothing) {
  StageExpectation expectation(0.98, kRetryAfter);
  for (int i = 0; i < 64; ++i) expectation.Add(milliseconds(10));
  expectation.Refused(kPeriodOfBudget);
  expectation.Add(milliseconds(20));
  EXPECT_EQ(expectation.value(), milliseconds(10));
}

TEST(StageExpectation, IsForgottenAfterATimeWhateverTheRate) {
  for (const auto& [period_us, num_refusals] : {std::pair{16'667, 60}, {40'000, 25}, {100'000, 10}}) {
    StageExpectation expectation(0.98, kRetryAfter);
    expectation.Add(milliseconds(100));
    for (int i = 0; i < num_refusals; ++i) {
      EXPECT_EQ(expectation.value(), milliseconds(100)) << period_us << " " << i;
      expectation.Refused(std::chrono::microseconds(period_us));
    }
    EXPECT_EQ(expectation.value(), Duration{0}) << period_us;
  }
}

// Frames whose stages take what the test says.
class Driver {
 public:
  explicit Driver(SchedulerConfig config = {}) : config_(config), budget_(config_, &clock_) {}

  struct Costs {
    int extract = 0, extract_reduced = 0, motion = 0, local_map = 0, local_map_reduced = 0;
  };

  // One tracked frame, taken up `late` after it was due. Returns its rung and leaves its latency.
  Rung Frame(const Costs& costs, Duration late = Duration{0}) {
    const TimePoint due = clock_.Now();
    clock_.Advance(late);
    budget_.BeginFrame(due + kPeriodOfBudget, true, false);
    Run(budget_.has_fewer_features() ? Stage::kExtractReduced : Stage::kExtract,
        budget_.has_fewer_features() ? costs.extract_reduced : costs.extract);
    Run(Stage::kMotion, costs.motion);
    budget_.ReconsiderPoints();
    Run(budget_.has_fewer_points() ? Stage::kLocalMapReduced : Stage::kLocalMap,
        budget_.has_fewer_points() ? costs.local_map_reduced : costs.local_map);
    latency_ = clock_.Now() - due;
    budget_.EndFrame();
    clock_.AdvanceTo(due + kPeriodOfBudget);
    return budget_.rung();
  }
  void Run(Stage stage, int ms) {
    const FrameBudget::Timer timer(budget_, stage);
    clock_.Advance(milliseconds(ms));
  }

  FrameBudget& budget() { return budget_; }
  ManualClock& clock() { return clock_; }
  Duration latency() const { return latency_; }

 private:
  SchedulerConfig config_;
  ManualClock clock_;
  FrameBudget budget_;
  Duration latency_{0};
};

TEST(FrameBudget, FrameWithTimeLeavesNothingOut) {
  Driver driver;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(driver.Frame({10, 5, 3, 4, 2}), Rung::kFull);
}

TEST(FrameBudget, SlowerExtractionTakesFewerFeaturesThenFewerPointsToo) {
  Driver driver;
  for (int i = 0; i < 64; ++i) driver.Frame({20, 12, 5, 8, 4});
  // 34 + 5 + 8 do not fit into 38; 20 + 5 + 8 do.
  for (int i = 0; i < 2; ++i) driver.Frame({34, 20, 5, 8, 4});
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(driver.Frame({34, 20, 5, 8, 4}), Rung::kFewerFeatures) << i;
    EXPECT_LE(driver.latency(), kPeriodOfBudget);
  }
  // 26 + 5 + 8 do not; 26 + 5 + 4 do.
  for (int i = 0; i < 2; ++i) driver.Frame({45, 26, 5, 8, 4});
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(driver.Frame({45, 26, 5, 8, 4}), Rung::kFewerPoints) << i;
    EXPECT_LE(driver.latency(), kPeriodOfBudget);
  }
}

TEST(FrameBudget, SlowStageBeforeTheLocalMapTakesFewerPoints) {
  Driver driver;
  for (int i = 0; i < 64; ++i) driver.Frame({10, 5, 5, 15, 5});
  // Nothing announced it; after 25 ms only 13 are left.
  EXPECT_EQ(driver.Frame({20, 5, 5, 15, 5}), Rung::kFewerPoints);
  EXPECT_EQ(driver.latency(), milliseconds(30));
}

TEST(FrameBudget, ComesBackUpWhenTheDeviceIsFastAgain) {
  Driver driver;
  const Driver::Costs slow{60, 20, 5, 8, 4}, fast{10, 5, 5, 8, 4};
  for (int i = 0; i < 64; ++i) driver.Frame(fast);
  for (int i = 0; i < 30; ++i) driver.Frame(slow);
  EXPECT_EQ(driver.budget().rung(), Rung::kFewerFeatures);
  int frames = 0;
  while (driver.Frame(fast) != Rung::kFull && frames < 200) ++frames;
  EXPECT_LT(frames, 50) << "two seconds";
  for (int i = 0; i < 50; ++i) EXPECT_EQ(driver.Frame(fast), Rung::kFull) << i;
}

TEST(FrameBudget, StillSlowDeviceIsTriedSeldom) {
  Driver driver;
  const Driver::Costs slow{60, 20, 5, 8, 4};
  for (int i = 0; i < 10; ++i) driver.Frame(slow);
  int num_full = 0;
  for (int i = 0; i < 250; ++i) {
    driver.Frame(slow);
    num_full += driver.budget().times()[static_cast<std::size_t>(Stage::kExtract)].count() > 0;
  }
  EXPECT_GE(num_full, 1);
  EXPECT_LE(num_full, 4);
}

TEST(FrameBudget, RefusedStageIsTriedAgainAfterATimeWhateverTheRate) {
  for (const auto& [period_ms, frames_within] : {std::pair{10, 100}, {40, 25}}) {
    Driver driver;
    driver.budget().SetFramePeriod(milliseconds(period_ms));
    driver.Frame({60, 20, 5, 8, 4});
    int num_refused = 0;
    const auto was_tried = [&] {
      driver.Frame({60, 20, 5, 8, 4});
      return driver.budget().times()[static_cast<std::size_t>(Stage::kExtract)].count() > 0;
    };
    while (!was_tried() && num_refused < 1000) ++num_refused;
    EXPECT_EQ(num_refused, frames_within) << period_ms;
  }
}

TEST(FrameBudget, FrameTakenUpLateHasLessTime) {
  Driver driver;
  for (int i = 0; i < 64; ++i) driver.Frame({14, 8, 4, 6, 3});
  EXPECT_EQ(driver.Frame({14, 8, 4, 6, 3}, milliseconds(10)), Rung::kFull);
  EXPECT_EQ(driver.Frame({14, 8, 4, 6, 3}, milliseconds(17)), Rung::kFewerFeatures);
  EXPECT_EQ(driver.Frame({14, 8, 4, 6, 3}, milliseconds(22)), Rung::kFewerPoints);
}

TEST(FrameBudget, RecoveryIsRefusedWithoutTimeAndTriedAgainInTheEnd) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  std::vector<bool> may;
  for (int i = 0; i < 6; ++i) {
    budget.BeginFrame(driver.clock().Now() + kPeriodOfBudget, false, false);
    may.push_back(budget.MayRecover(true));
    if (i == 4) {
      EXPECT_GE(budget.wait_deadline(), driver.clock().Now() + 2 * kPeriodOfBudget) << "it would be cut off again";
    }
    if (may.back()) driver.Run(Stage::kRecovery, 200);
    EXPECT_EQ(budget.rung(), may.back() ? Rung::kFull : Rung::kNoRecovery);
    budget.EndFrame();
  }
  EXPECT_EQ(may, (std::vector<bool>{true, false, false, false, true, false}));
}

TEST(FrameBudget, RecoveryWhileTrackingIsNeverWorthTheDeadline) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  budget.BeginFrame(driver.clock().Now() + kPeriodOfBudget, true, false);
  ASSERT_TRUE(budget.MayRecover(false));
  driver.Run(Stage::kRecovery, 2000);
  budget.EndFrame();
  for (int i = 0; i < 20; ++i) {
    budget.BeginFrame(driver.clock().Now() + kPeriodOfBudget, true, false);
    EXPECT_FALSE(budget.MayRecover(false)) << i;
    budget.EndFrame();
  }
}

// An attempt to found a map that would take 60 ms: begun while that is not known, stopped when the frame's time is
// over, then refused; the fourth frame lets it have its end. What it took is known then.
TEST(FrameBudget, FoundingIsStoppedOrRefusedWithoutTimeAndTakesItInTheEnd) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  std::string story;
  for (int i = 0; i < 9; ++i) {
    const TimePoint due = driver.clock().Now();
    budget.BeginFrame(due + kPeriodOfBudget, false, false);
    if (!budget.MayInitialise()) {
      story += "refused ";
      EXPECT_EQ(budget.rung(), Rung::kNoRecovery);
    } else {
      int ms = 0;
      {
        const FrameBudget::Timer timer(budget, Stage::kInitialise);
        for (; ms < 60 && !budget.ShouldStopInitialising(); ++ms) driver.clock().Advance(milliseconds(1));
      }
      budget.EndInitialising(ms < 60);
      story += ms < 60 ? "stopped " : "done ";
      EXPECT_EQ(budget.rung(), ms < 60 ? Rung::kNoRecovery : Rung::kFull);
      EXPECT_EQ(driver.clock().Now() > due + kPeriodOfBudget, ms == 60);
    }
    budget.EndFrame();
    driver.clock().AdvanceTo(due + kPeriodOfBudget);
  }
  EXPECT_EQ(story, "stopped refused refused done refused refused refused done refused ");
}

TEST(FrameBudget, FoundingThatTakesItsTimeWaitsForTheDeviceBeyondTheDeadline) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  for (int i = 0; i < 4; ++i) {
    const TimePoint due = driver.clock().Now();
    budget.BeginFrame(due + kPeriodOfBudget, false, false);
    ASSERT_TRUE(budget.MayInitialise());
    EXPECT_EQ(budget.initialise_deadline() > due + kPeriodOfBudget, i == 3) << i;
    budget.EndInitialising(i < 3);
    budget.EndFrame();
  }
  const SchedulerConfig config;
  FrameBudget timeless(config, nullptr);
  timeless.BeginFrame(kNoDeadline, false, false);
  EXPECT_TRUE(timeless.MayInitialise());
  EXPECT_FALSE(timeless.ShouldStopInitialising());
  EXPECT_EQ(timeless.initialise_deadline(), kNoDeadline);
}

TEST(FrameBudget, LostFrameGetsAllFeaturesAndTheTimeForThem) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  for (int i = 0; i < 70; ++i) driver.Frame({60, 20, 5, 8, 4});
  const TimePoint deadline = driver.clock().Now() + kPeriodOfBudget;
  budget.BeginFrame(deadline, false, true);
  EXPECT_FALSE(budget.has_fewer_features());
  EXPECT_GT(budget.wait_deadline(), deadline);
  EXPECT_LE(budget.wait_deadline(), driver.clock().Now() + milliseconds(100));
  budget.EndFrame();
  // One that looks for its first map has frames to lose.
  budget.BeginFrame(deadline, false, false);
  EXPECT_TRUE(budget.has_fewer_features());
}

TEST(FrameBudget, LostFrameKeepsItsDeadlineWhereNoTimeIsAllowedForIt) {
  SchedulerConfig config;
  config.lost_time_ms = 0.0;
  Driver driver(config);
  for (int i = 0; i < 70; ++i) driver.Frame({60, 20, 5, 8, 4});
  driver.budget().BeginFrame(driver.clock().Now() + kPeriodOfBudget, false, true);
  EXPECT_TRUE(driver.budget().has_fewer_features());
}

TEST(FrameBudget, LostFrameKeepsItsDeadlineWhereAllFeaturesAreQuickOrHopeless) {
  for (const auto& [extract_ms, has_fewer] : {std::pair{20, false}, {160, true}}) {
    Driver driver;
    driver.Frame({extract_ms, 20, 5, 8, 4});
    const TimePoint deadline = driver.clock().Now() + kPeriodOfBudget;
    driver.budget().BeginFrame(deadline, false, true);
    EXPECT_EQ(driver.budget().has_fewer_features(), has_fewer) << extract_ms;
    EXPECT_LT(driver.budget().wait_deadline(), deadline) << extract_ms;
  }
}

// What was given up at its deadline lasted no longer than that, and would seem to fit for ever.
TEST(FrameBudget, StageThatWasGivenUpIsExpectedToTakeLonger) {
  Driver driver;
  FrameBudget& budget = driver.budget();
  for (int i = 0; i < 3; ++i) {
    budget.BeginFrame(driver.clock().Now() + kPeriodOfBudget, false, true);
    const TimePoint until = budget.wait_deadline();
    if (!budget.has_fewer_features()) {
      const FrameBudget::Timer timer(budget, Stage::kExtract);
      driver.clock().AdvanceTo(until);
    }
    budget.GaveUp();
    budget.EndFrame();
  }
  budget.BeginFrame(driver.clock().Now() + kPeriodOfBudget, false, true);
  EXPECT_TRUE(budget.has_fewer_features());
}

TEST(FrameBudget, WaitsEndBeforeTheDeadline) {
  Driver driver;
  const TimePoint now = driver.clock().Now();
  driver.budget().BeginFrame(now + kPeriodOfBudget, true, false);
  EXPECT_EQ(driver.budget().wait_deadline(), now + milliseconds(38));
  driver.clock().Advance(milliseconds(50));  // too late already: as soon as it can be, but not for ever
  EXPECT_GT(driver.budget().wait_deadline(), driver.clock().Now());
  EXPECT_LE(driver.budget().wait_deadline(), driver.clock().Now() + milliseconds(100));
}

TEST(FrameBudget, WithoutADeadlineOrAClockEverythingIsAffordable) {
  ManualClock clock;
  const SchedulerConfig config;
  for (const Clock* c : {static_cast<const Clock*>(nullptr), static_cast<const Clock*>(&clock)}) {
    FrameBudget budget(config, c);
    for (int i = 0; i < 3; ++i) {
      budget.BeginFrame(kNoDeadline, true, false);
      EXPECT_FALSE(budget.has_fewer_features() || budget.has_fewer_points() || budget.is_over());
      EXPECT_TRUE(budget.MayRecover(false));
      {
        const FrameBudget::Timer timer(budget, Stage::kRecovery);
        clock.Advance(milliseconds(900));
      }
      EXPECT_EQ(budget.wait_deadline(), kNoDeadline);
      budget.EndFrame();
      EXPECT_EQ(budget.rung(), Rung::kFull);
    }
  }
}

TEST(FrameBudget, SwitchedOffLeavesNothingOut) {
  ManualClock clock;
  SchedulerConfig config;
  config.degrade = false;
  FrameBudget budget(config, &clock);
  for (int i = 0; i < 3; ++i) {
    budget.BeginFrame(clock.Now() + kPeriodOfBudget, true, false);
    EXPECT_FALSE(budget.has_fewer_features());
    const FrameBudget::Timer timer(budget, Stage::kExtract);
    clock.Advance(milliseconds(90));
    EXPECT_TRUE(budget.CanAfford(Stage::kLocalMap));
    EXPECT_EQ(budget.wait_deadline(), kNoDeadline);
    budget.EndFrame();
  }
}

}  // namespace
}  // namespace haustra
