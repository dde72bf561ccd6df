#include "tools/run/map_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "hal/fakes/manual_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using test::ScriptedColon;

constexpr double kStepS = 2.5;

// A scope that is withdrawn from the end of a rigid tube for 16 s, and steps to and fro by `swing` meanwhile. What it
// sees at first is nearer than later, so the unit of the map is not the depth.
std::vector<MapMotion> MotionsOfTravel(double swing, TimePoint start) {
  ScriptedColon colon(start);
  for (int i = 0; i < 400; ++i) {
    const double time_s = i * ToSeconds(test::kFramePeriod);
    const double place = 20.9 - 0.3 * time_s + swing * std::sin(2.0 * std::numbers::pi * time_s / kStepS);
    colon.Move(place, place, 1);
  }
  const auto engine = colon.MakeEngine();
  RunRecord record({});
  const auto session = RunSequential(colon.source(), *engine, ManualClock(), record, test::kNeverStop);
  EXPECT_TRUE(session.ok()) << session.status().ToString();
  return FindMapMotions(record, ResolveAll(record, *engine), *engine);
}

TEST(MapMotion, StepsToAndFroAreFoundInSharesOfTheDepth) {
  const std::vector<MapMotion> motions = MotionsOfTravel(0.12, TimePoint(std::chrono::hours(5)));
  ASSERT_EQ(motions.size(), 1u);
  ASSERT_EQ(motions[0].motion.stretches.size(), 1u);
  const PeriodicStretch& found = motions[0].motion.stretches[0];
  EXPECT_NEAR(found.period_s, kStepS, 0.15);
  // The tube is seen from 0.3 to 3 radii ahead: its median depth is 1.5 to 2.3.
  EXPECT_GE(found.amplitude, 0.12 / 2.3);
  EXPECT_LE(found.amplitude, 0.12 / 1.5);
  EXPECT_NEAR(found.from_s, 0.0, 0.5);
  EXPECT_NEAR(found.to_s, 16.0, 0.5);
}

TEST(MapMotion, OfPlainTravelThereIsNone) {
  const std::vector<MapMotion> motions = MotionsOfTravel(0.0, TimePoint{});
  ASSERT_EQ(motions.size(), 1u);
  EXPECT_GT(motions[0].motion.longest_period_s, kStepS);
  EXPECT_TRUE(motions[0].motion.stretches.empty());
}

TEST(MapMotion, ARunWithoutAMapHasNone) {
  ScriptedColon colon;
  const auto engine = colon.MakeEngine();
  EXPECT_TRUE(FindMapMotions(RunRecord({}), {}, *engine).empty());
}

}  // namespace
}  // namespace haustra
