#include "tools/evaluate/path_segments.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/tools/evaluate/synthetic_run.h"
#include "tools/evaluate/trajectory_error.h"

namespace haustra::evaluate {
namespace {

constexpr int kMap = 2;
constexpr double kSegmentMm = 100.0;

// One round of the ring in one map, at `believe(true pose, index)`.
template <typename Believe>
std::vector<EvaluatedFrame> OneRound(Believe&& believe) {
  std::vector<EvaluatedFrame> frames;
  for (int i = 0; i < kFramesPerRound; ++i) frames.push_back(MakeFrame(i, kMap, kMap, believe(TruePose(i), i)));
  return frames;
}

std::vector<MapEvaluation> Aligned(const std::vector<EvaluatedFrame>& frames) {
  std::vector<PosePair> pairs;
  for (const EvaluatedFrame& frame : frames) {
    if (frame.is_localised()) pairs.push_back(frame.pair());
  }
  MapEvaluation map;
  map.map_id = kMap;
  map.truth_from_map = Align(pairs)->truth_from_map;
  return {map};
}

// Along the ring, by geometry: each stretch has the frames whose way so far lies in it.
TEST(PathSegments, StretchesAreOfTheTruePathAndHoldEveryFrameOnce) {
  auto frames = OneRound([](const SE3& pose, int) { return pose; });
  for (int i = 50; i < 60; ++i) frames[i] = LostFrame(i);
  const auto segments = EvaluateSegments(frames, Aligned(frames), kSegmentMm);
  double way = 0.0;
  std::vector<std::size_t> count(8, 0);
  for (int i = 0; i < kFramesPerRound; ++i) {
    if (i > 0) way += (TruePose(i).translation - TruePose(i - 1).translation).norm();
    ++count[static_cast<std::size_t>(way / kSegmentMm)];
  }
  ASSERT_EQ(segments.size(), static_cast<std::size_t>(way / kSegmentMm) + 1);
  std::size_t localised = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    EXPECT_EQ(segments[i].begin, kSegmentMm * static_cast<double>(i));
    EXPECT_EQ(segments[i].frames, count[i]);
    EXPECT_LT(*segments[i].rms_ate, 1e-9);
    EXPECT_LT(*segments[i].rms_own, 1e-9);
    localised += segments[i].localised;
  }
  EXPECT_EQ(localised, kFramesPerRound - 10u);
}

// The second half of the map is 10 % too large: bent as a whole, and true in each half.
TEST(PathSegments, AMapThatDriftsIsTrueInItself) {
  const Eigen::Vector3d middle = TruePose(kFramesPerRound / 2).translation;
  const auto frames = OneRound([&](SE3 pose, int i) {
    if (i >= kFramesPerRound / 2) pose.translation = middle + 1.1 * (pose.translation - middle);
    return pose;
  });
  const auto segments = EvaluateSegments(frames, Aligned(frames), 0.5 * 6.4 * 60.0);
  ASSERT_GE(segments.size(), 2u);
  EXPECT_GT(*segments[0].rms_ate, 0.5);
  EXPECT_LT(*segments[0].rms_own, 0.2);
  EXPECT_GT(*segments[1].rms_ate, 0.5);
  EXPECT_LT(*segments[1].rms_own, 0.2);
}

TEST(PathSegments, AnErrorIsWhereItIs) {
  const auto frames = OneRound([](SE3 pose, int i) {
    if (i < 40) pose.translation.z() += i % 2 == 0 ? 0.5 : -0.5;
    return pose;
  });
  const auto segments = EvaluateSegments(frames, Aligned(frames), kSegmentMm);
  ASSERT_GE(segments.size(), 4u);
  const double share = 40.0 / static_cast<double>(segments[0].frames);
  EXPECT_NEAR(*segments[0].rms_ate, 0.5 * std::sqrt(share), 0.02);
  EXPECT_LT(*segments[3].rms_ate, 0.05);
}

TEST(PathSegments, WhatCannotBeAlignedHasNoErrorOfItsOwn) {
  auto frames = OneRound([](const SE3& pose, int) { return pose; });
  for (int i = 5; i < 60; ++i) frames[i] = LostFrame(i);
  const auto segments = EvaluateSegments(frames, Aligned(frames), 50.0);
  EXPECT_EQ(segments[0].localised, 5u);
  EXPECT_FALSE(segments[0].rms_own.has_value());
  EXPECT_EQ(segments[0].own_frames, 0u);
  EXPECT_TRUE(segments[0].rms_ate.has_value());
  // The whole stretch is lost.
  EXPECT_EQ(segments[1].localised, 0u);
  EXPECT_FALSE(segments[1].rms_ate.has_value());
}

}  // namespace
}  // namespace haustra::evaluate
