#include "tools/benchmarks/pair_judge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/geometry/rng.h"

namespace haustra::benchmarks {
namespace {

constexpr int kWidth = 720;
constexpr int kHeight = 540;
constexpr double kFocal = 400.0;

struct Pair {
  FrameFeatures a{2000}, b{2000};
  std::vector<Match> matches;

  void Add(const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    for (FrameFeatures* features : {&a, &b}) {
      const Eigen::Vector2d& px = features == &a ? from : to;
      const int i = features->num++;
      features->keypoints[i] = {static_cast<float>(px.x()), static_cast<float>(px.y()), 2.0f, 0.0f, 0.1f, 0};
      const Eigen::Vector3d ray =
          Eigen::Vector3d((px.x() - 0.5 * kWidth) / kFocal, (px.y() - 0.5 * kHeight) / kFocal, 1.0).normalized();
      features->bearings[i] = {static_cast<float>(ray.x()), static_cast<float>(ray.y()), static_cast<float>(ray.z())};
    }
    matches.push_back({a.num - 1, b.num - 1, 0.99f, 0.5f});
  }
};

Eigen::Vector2d Project(const Eigen::Vector3d& point) {
  return {0.5 * kWidth + kFocal * point.x() / point.z(), 0.5 * kHeight + kFocal * point.y() / point.z()};
}

// Points at many depths, seen before and after the camera moved; `turn_rad` about the vertical axis.
Pair Move(const Eigen::Vector3d& step, double turn_rad, int num_true, int num_false) {
  Pair pair;
  Rng rng(4, 1);
  const Eigen::AngleAxisd turn(turn_rad, Eigen::Vector3d::UnitY());
  while (static_cast<int>(pair.matches.size()) < num_true) {
    const Eigen::Vector3d point(rng.Uniform(-2.0, 2.0), rng.Uniform(-1.5, 1.5), rng.Uniform(2.0, 6.0));
    pair.Add(Project(point), Project(turn * (point - step)));
  }
  for (int i = 0; i < num_false; ++i) {
    pair.Add({rng.Uniform(0.0, kWidth), rng.Uniform(0.0, kHeight)},
             {rng.Uniform(0.0, kWidth), rng.Uniform(0.0, kHeight)});
  }
  return pair;
}

class PairJudgeTest : public ::testing::Test {
 protected:
  PairFigures Judge(const Pair& pair) { return judge_.Judge(pair.a, pair.b, pair.matches); }

  EngineConfig config_;
  PairJudge judge_{config_, kWidth, kHeight, kFocal};
};

TEST_F(PairJudgeTest, CountsTheTrueMatchesOfAMotionWithDepth) {
  const PairFigures figures = Judge(Move({0.3, 0.1, 0.1}, 0.03, 200, 100));
  EXPECT_EQ(figures.matches, 300);
  EXPECT_GE(figures.inliers, 200);
  EXPECT_LE(figures.inliers, 210);  // chance
  EXPECT_EQ(figures.inliers_of_octave[1], figures.inliers);
  EXPECT_GE(figures.parts, 60);
}

TEST_F(PairJudgeTest, ARotationIsAMotion) {
  const PairFigures figures = Judge(Move({0.0, 0.0, 0.0}, 0.05, 200, 60));
  EXPECT_GE(figures.inliers, 200);
  EXPECT_LE(figures.inliers, 208);
}

TEST_F(PairJudgeTest, FalseMatchesAloneHaveHardlyAnInlier) {
  EXPECT_LE(Judge(Move({0.0, 0.0, 0.0}, 0.0, 0, 100)).inliers, 20);
}

TEST_F(PairJudgeTest, APlaceCountsOnce) {
  Pair pair = Move({0.3, 0.1, 0.1}, 0.03, 100, 0);
  for (int i = 0; i < 50; ++i) pair.Add(pair.a.pixel(i), pair.b.pixel(i));
  const PairFigures figures = Judge(pair);
  EXPECT_EQ(figures.inliers, 150);
  EXPECT_LE(figures.places, 100);
}

TEST_F(PairJudgeTest, WhatStandsStillWhileTheRestMovesIsSaid) {
  // Along the axis: places at rest are as if far away.
  Pair pair = Move({0.0, 0.0, 0.5}, 0.0, 200, 0);
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector2d at(20.0 + 7.0 * i, 30.0);
    pair.Add(at, at);
  }
  const PairFigures figures = Judge(pair);
  EXPECT_GE(figures.still, 28);
  EXPECT_LE(figures.still, 34);
}

TEST_F(PairJudgeTest, AnswersTheSameWhateverCameBefore) {
  const Pair pair = Move({0.3, 0.1, 0.1}, 0.03, 200, 150);
  const int first = Judge(pair).inliers;
  Judge(Move({0.1, 0.3, 0.2}, 0.0, 80, 90));
  EXPECT_EQ(Judge(pair).inliers, first);
}

TEST_F(PairJudgeTest, NoMatchesGiveNoInliers) { EXPECT_EQ(Judge(Pair{}).inliers, 0); }

}  // namespace
}  // namespace haustra::benchmarks
