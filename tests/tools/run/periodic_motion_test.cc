#include "tools/run/periodic_motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/tools/run/wandering_scope.h"

namespace haustra {
namespace {

using test::kBreathS;
using test::Wander;

TEST(PeriodicMotion, BreathOnARandomWalkIsFoundWithPeriodAndAmplitude) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const PeriodicMotion motion = FindPeriodicMotion(Wander(seed, 60.0, 0.05, {0.04}));
    ASSERT_EQ(motion.stretches.size(), 1u) << seed;
    const PeriodicStretch& found = motion.stretches[0];
    EXPECT_NEAR(found.period_s, kBreathS, 0.12) << seed;
    EXPECT_NEAR(found.amplitude, 0.04, 0.01) << seed;
    EXPECT_LE(found.chance, kMaxChance) << seed;
    EXPECT_NEAR(found.from_s, 0.0, 0.3) << seed;
    EXPECT_NEAR(found.to_s, 60.0, 0.3) << seed;
  }
}

// So fast that most of the walks have a line above the smallest amplitude: only the test keeps them out.
TEST(PeriodicMotion, RandomWalkAloneIsRarelyTakenForABreath) {
  int num_found = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    num_found += FindPeriodicMotion(Wander(seed, 60.0, 0.4)).stretches.empty() ? 0 : 1;
  }
  EXPECT_LE(num_found, 9);  // kMaxChance, and three times the spread of 300 draws
}

TEST(PeriodicMotion, TravelToAndFroWithoutAPeriodGivesNone) {
  std::vector<MotionSample> samples = Wander(3, 60.0, 0.02);
  for (MotionSample& sample : samples) {
    const double at = sample.time_s;
    sample.centre_mu.z() += 0.3 * (at < 13.0 ? at : at < 22.0 ? 26.0 - at : at < 41.0 ? at - 18.0 : 64.0 - at);
  }
  EXPECT_TRUE(FindPeriodicMotion(samples).stretches.empty());
}

// A turn moves the scope by much more than a breath.
TEST(PeriodicMotion, OfATurningScopeTheBreathIsFoundAllTheSame) {
  std::vector<MotionSample> samples = Wander(3, 60.0, 0.02, {0.05});
  for (MotionSample& sample : samples) sample.centre_mu.z() += 3.0 * std::abs(sample.time_s - 31.0);
  const PeriodicMotion motion = FindPeriodicMotion(samples);
  ASSERT_EQ(motion.stretches.size(), 1u);
  EXPECT_NEAR(motion.stretches[0].period_s, kBreathS, 0.12);
  EXPECT_NEAR(motion.stretches[0].amplitude, 0.05, 0.005);
}

TEST(PeriodicMotion, QuickMotionIsNotSmoothedAway) {
  const PeriodicMotion motion = FindPeriodicMotion(Wander(4, 60.0, 0.001, {0.1, 0.0, 1e9, 1.6}));
  ASSERT_EQ(motion.stretches.size(), 1u);
  EXPECT_NEAR(motion.stretches[0].period_s, 1.6, 0.02);
  EXPECT_NEAR(motion.stretches[0].amplitude, 0.1, 0.002);
}

TEST(PeriodicMotion, SmallMotionIsNotReported) {
  EXPECT_TRUE(FindPeriodicMotion(Wander(4, 60.0, 0.002, {0.015})).stretches.empty());
  EXPECT_FALSE(FindPeriodicMotion(Wander(4, 60.0, 0.002, {0.025})).stretches.empty());
}

TEST(PeriodicMotion, SidewaysMotionIsNotLookedAt) {
  std::vector<MotionSample> samples = Wander(5, 60.0, 0.02, {0.05});
  for (MotionSample& sample : samples) sample.axis = Eigen::Vector3d::UnitX();
  EXPECT_TRUE(FindPeriodicMotion(samples).stretches.empty());
}

TEST(PeriodicMotion, TheUnitOfTheMapDoesNotMatter) {
  const PeriodicMotion small = FindPeriodicMotion(Wander(6, 60.0, 0.03, {0.05}, 0.125));
  const PeriodicMotion large = FindPeriodicMotion(Wander(6, 60.0, 0.03, {0.05}, 64.0));
  ASSERT_EQ(small.stretches.size(), 1u);
  ASSERT_EQ(large.stretches.size(), 1u);
  EXPECT_DOUBLE_EQ(small.stretches[0].period_s, large.stretches[0].period_s);
  EXPECT_NEAR(small.stretches[0].amplitude, large.stretches[0].amplitude, 1e-9);
}

TEST(PeriodicMotion, FourAndAHalfPeriodsAreNeeded) {
  EXPECT_NEAR(FindPeriodicMotion(Wander(7, 20.0, 0.01)).longest_period_s, 20.0 / 4.5, 0.3);
  EXPECT_EQ(FindPeriodicMotion(Wander(7, 60.0, 0.01)).longest_period_s, kLongestPeriodS);
  const PeriodicMotion brief = FindPeriodicMotion(Wander(7, 6.0, 0.01, {0.1}));
  EXPECT_EQ(brief.longest_period_s, 0.0);
  EXPECT_TRUE(brief.stretches.empty());
}

TEST(PeriodicMotion, NoPathIsTooShort) {
  EXPECT_EQ(FindPeriodicMotion({}).longest_period_s, 0.0);
  EXPECT_EQ(FindPeriodicMotion(Wander(8, 0.03, 0.01)).longest_period_s, 0.0);
  EXPECT_EQ(FindPeriodicMotion(Wander(8, 0.1, 0.01)).longest_period_s, 0.0);
}

// Where the scope was found again the map may be off.
TEST(PeriodicMotion, LossesLeaveItFound) {
  std::vector<MotionSample> samples = Wander(9, 60.0, 0.03, {0.05});
  std::erase_if(samples, [](const MotionSample& sample) { return std::fmod(sample.time_s, 6.0) < 0.8; });
  for (MotionSample& sample : samples) sample.centre_mu.z() += 2.0 * std::floor(sample.time_s / 6.0);
  const PeriodicMotion motion = FindPeriodicMotion(samples);
  ASSERT_EQ(motion.stretches.size(), 1u);
  EXPECT_NEAR(motion.stretches[0].period_s, kBreathS, 0.12);
  EXPECT_NEAR(motion.stretches[0].amplitude, 0.05, 0.0125);
}

TEST(PeriodicMotion, APathThatIsMostlyLostSaysNothing) {
  std::vector<MotionSample> samples = Wander(9, 60.0, 0.03, {0.05});
  std::erase_if(samples, [](const MotionSample& sample) { return std::fmod(sample.time_s, 2.0) > 0.8; });
  EXPECT_EQ(FindPeriodicMotion(samples).longest_period_s, 0.0);
}

TEST(PeriodicMotion, PartsBeforeAndAfterALongAbsenceAreFoundApart) {
  std::vector<MotionSample> samples = Wander(10, 200.0, 0.02, {0.06});
  std::erase_if(samples, [](const MotionSample& sample) { return sample.time_s > 60.0 && sample.time_s < 140.0; });
  const PeriodicMotion motion = FindPeriodicMotion(samples);
  ASSERT_EQ(motion.stretches.size(), 2u);
  EXPECT_NEAR(motion.stretches[0].to_s, 60.0, 0.3);
  EXPECT_NEAR(motion.stretches[1].from_s, 140.0, 0.3);
}

TEST(PeriodicMotion, SaysInWhichPartItWasSeen) {
  const PeriodicMotion motion = FindPeriodicMotion(Wander(11, 300.0, 0.03, {0.06, 120.0, 240.0}));
  ASSERT_EQ(motion.stretches.size(), 1u);
  EXPECT_NEAR(motion.stretches[0].from_s, 120.0, 31.0);  // stretches of 60 s begin every 30 s
  EXPECT_NEAR(motion.stretches[0].to_s, 240.0, 31.0);
}

}  // namespace
}  // namespace haustra
