#include "tools/evaluate/trajectory_error.h"

#include <gtest/gtest.h>

#include "tests/tools/evaluate/synthetic_run.h"

namespace haustra::evaluate {
namespace {

// Frames of one map of which the run believes that they were at `believe(true pose, index)`.
template <typename Believe>
std::vector<PosePair> MakePairs(int count, const Sim3& map_from_world, Believe&& believe) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < count; ++i) pairs.push_back({Moved(map_from_world, believe(TruePose(i), i)), TruePose(i)});
  return pairs;
}

SE3 Exactly(const SE3& pose, int) { return pose; }

TEST(Align, KnownSim3IsUndoneCompletely) {
  const Sim3 map_from_world = MapFromWorld(3);
  const std::optional<Alignment> alignment = Align(MakePairs(100, map_from_world, Exactly));
  ASSERT_TRUE(alignment.has_value());
  EXPECT_LT(alignment->rms(), 1e-9);
  EXPECT_LT(alignment->max_error, 1e-9);
  EXPECT_NEAR(alignment->truth_from_map.scale, 1.0 / map_from_world.scale, 1e-9);
}

TEST(Align, IndependentNoiseIsTheError) {
  constexpr double kSigma = 0.5;
  Jitter jitter(kSigma);
  const std::optional<Alignment> alignment =
      Align(MakePairs(4000, MapFromWorld(1), [&](const SE3& pose, int) { return jitter(pose); }));
  ASSERT_TRUE(alignment.has_value());
  EXPECT_NEAR(alignment->rms(), kSigma * std::sqrt(3.0), 0.02);
}

TEST(Align, AlternatingOffsetIsTheErrorAndTheMaximum) {
  const auto believe = [](SE3 pose, int i) {
    pose.translation.z() += i % 2 == 0 ? 0.2 : -0.2;
    return pose;
  };
  const std::optional<Alignment> alignment = Align(MakePairs(kFramesPerRound, MapFromWorld(1), believe));
  ASSERT_TRUE(alignment.has_value());
  EXPECT_NEAR(alignment->rms(), 0.2, 1e-3);
  EXPECT_NEAR(alignment->max_error, 0.2, 5e-3);
}

TEST(Align, FewerThanTenFramesAreLeftOut) {
  EXPECT_FALSE(Align(MakePairs(9, MapFromWorld(1), Exactly)).has_value());
  EXPECT_TRUE(Align(MakePairs(10, MapFromWorld(1), Exactly)).has_value());
}

TEST(Align, FramesOnALineAreLeftOut) {
  std::vector<PosePair> pairs;
  for (int i = 0; i < 50; ++i) {
    const SE3 pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(i, 2.0 * i, 0.0));
    pairs.push_back({pose, pose});
  }
  EXPECT_FALSE(Align(pairs).has_value());
}

TEST(FindScaleDrift, ConstantScaleIsNoDrift) {
  const std::optional<double> drift = FindScaleDrift(MakePairs(100, MapFromWorld(2), Exactly));
  ASSERT_TRUE(drift.has_value());
  EXPECT_NEAR(*drift, 1.0, 1e-9);
}

TEST(FindScaleDrift, ScaleOfTheLastQuarterOverThatOfTheFirst) {
  // The run believes in steps of 80 % of their length in the second half: there a map unit is worth 1 / 0.8 as much.
  std::vector<PosePair> pairs;
  Eigen::Vector3d believed = TruePose(0).translation;
  for (int i = 0; i < 120; ++i) {
    if (i > 0) believed += (i > 60 ? 0.8 : 1.0) * (TruePose(i).translation - TruePose(i - 1).translation);
    pairs.push_back({Moved(MapFromWorld(1), SE3(TruePose(i).rotation, believed)), TruePose(i)});
  }
  const std::optional<double> drift = FindScaleDrift(pairs);
  ASSERT_TRUE(drift.has_value());
  EXPECT_NEAR(*drift, 1.25, 1e-6);
}

TEST(FindScaleDrift, NothingForShortMaps) {
  EXPECT_FALSE(FindScaleDrift(MakePairs(19, MapFromWorld(1), Exactly)).has_value());
  EXPECT_FALSE(FindScaleDrift({}).has_value());
}

}  // namespace
}  // namespace haustra::evaluate
