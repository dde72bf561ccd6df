#include "engine/geometry/two_view.h"
#include "engine/geometry/constants.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "tests/geometry/allocation_counter.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

constexpr double kHalfPixelRad = 0.5 / 400.0;  // half a pixel of the colon camera
constexpr double kHalfPixelTolerance = 1.96 * kHalfPixelRad;

constexpr int kScenes = test::Trials(200);

enum class Shape { kBox, kTube, kPlane };

struct TwoViewScene {
  SE3 b_from_a;
  std::vector<Eigen::Vector3d> points, a, b;
  std::vector<double> tolerance;
  int num_true = 0;
};

Eigen::Vector3d ScenePoint(Rng& rng, Shape shape) {
  switch (shape) {
    case Shape::kTube: return test::TubePoint(rng, 5.0);
    case Shape::kPlane: {
      const double x = rng.Uniform(-3, 3), y = rng.Uniform(-3, 3);
      return {x, y, 3.0 + 0.4 * x};
    }
    case Shape::kBox: break;
  }
  const double x = rng.Uniform(-3, 3), y = rng.Uniform(-3, 3), z = rng.Uniform(1, 5);
  return {x, y, z};
}

// Baseline `translation`; the last share of the matches is paired at random.
TwoViewScene MakeTwoViewScene(Rng& rng, Shape shape, int count, const Eigen::Vector3d& translation,
                              double outlier_share, double sigma_rad) {
  const CameraModel camera = test::ColonCamera();
  TwoViewScene scene;
  scene.b_from_a = SE3(test::RandomRotation(rng, 0.2), translation);
  scene.num_true = static_cast<int>(count * (1.0 - outlier_share));
  while (static_cast<int>(scene.a.size()) < count) {
    const Eigen::Vector3d point = ScenePoint(rng, shape);
    const Eigen::Vector3d in_b = scene.b_from_a * point;
    Eigen::Vector2d pixel_a, pixel_b;
    if (!camera.Project(point, &pixel_a) || !camera.IsInImage(pixel_a)) continue;
    if (!camera.Project(in_b, &pixel_b) || !camera.IsInImage(pixel_b)) continue;
    const bool is_true = static_cast<int>(scene.a.size()) < scene.num_true;
    scene.points.push_back(point);
    scene.a.push_back(test::NoisyBearing(rng, point.normalized(), sigma_rad));
    scene.b.push_back(is_true ? test::NoisyBearing(rng, in_b.normalized(), sigma_rad)
                              : test::RandomBearing(rng, camera));
  }
  scene.tolerance.assign(count, kHalfPixelTolerance);
  return scene;
}

double TranslationAngle(const SE3& estimate, const SE3& truth) {
  return std::acos(std::clamp(estimate.translation.normalized().dot(truth.translation.normalized()), -1.0, 1.0));
}

// Trials of `count` matches in which rotation and direction of translation are within the limits.
int CountSuccesses(Rng& rng, Shape shape, int trials, double outlier_share, bool is_forward, double max_turned_rad,
                   double max_direction_rad) {
  TwoViewRansac ransac(300);
  int succeeded = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Eigen::Vector3d sideways(rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-0.5, 0.5));
    const Eigen::Vector3d forward(rng.Uniform(-0.1, 0.1), rng.Uniform(-0.1, 0.1), -1.0);
    const Eigen::Vector3d translation = 0.4 * (is_forward ? forward : sideways).normalized();
    const TwoViewScene scene = MakeTwoViewScene(rng, shape, 250, translation, outlier_share, kHalfPixelRad);
    TwoViewRansac::Estimate estimate;
    if (!ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate)) continue;
    EXPECT_NEAR(estimate.b_from_a.translation.norm(), 1.0, 1e-12);
    if (RotationAngle(estimate.b_from_a.rotation, scene.b_from_a.rotation) < max_turned_rad &&
        TranslationAngle(estimate.b_from_a, scene.b_from_a) < max_direction_rad) {
      ++succeeded;
    }
  }
  return succeeded;
}

TEST(TwoViewRansac, FindsSidewaysMotionInABoxAmongOutliers) {
  Rng rng(1);
  EXPECT_GE(CountSuccesses(rng, Shape::kBox, kScenes, 0.35, false, 0.4 * kDegree, 3.0 * kDegree), kScenes * 99 / 100);
}

TEST(TwoViewRansac, FindsForwardMotionInATubeAmongOutliers) {
  Rng rng(2);
  EXPECT_GE(CountSuccesses(rng, Shape::kTube, kScenes, 0.35, true, 0.4 * kDegree, 3.0 * kDegree), kScenes * 99 / 100);
}

TEST(TwoViewRansac, FindsSidewaysMotionInATubeAmongOutliers) {
  Rng rng(3);
  EXPECT_GE(CountSuccesses(rng, Shape::kTube, kScenes, 0.35, false, 0.4 * kDegree, 3.0 * kDegree), kScenes * 99 / 100);
}

TEST(TwoViewRansac, ExactDataGivesTheExactMotionAndPoints) {
  Rng rng(4);
  TwoViewRansac ransac(100);
  const TwoViewScene scene = MakeTwoViewScene(rng, Shape::kBox, 100, Eigen::Vector3d(0.4, 0.1, -0.2), 0.0, 0.0);
  TwoViewRansac::Estimate estimate;
  ASSERT_TRUE(ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate));
  EXPECT_EQ(estimate.num_inliers, 100);
  EXPECT_NEAR(estimate.score, 100.0, 1e-6);
  EXPECT_LT(RotationAngle(estimate.b_from_a.rotation, scene.b_from_a.rotation), 1e-7);
  EXPECT_LT(TranslationAngle(estimate.b_from_a, scene.b_from_a), 1e-6);
  const double baseline = scene.b_from_a.translation.norm();
  for (int i = 0; i < 100; ++i) {
    EXPECT_LT((baseline * ransac.points_in_a()[i] - scene.points[i]).norm(), 1e-3);
    const Eigen::Vector3d ray_a = scene.b_from_a.rotation * scene.a[i];
    EXPECT_NEAR(ransac.parallax_rad()[i], std::acos(ray_a.dot(scene.b[i])), 1e-5);
  }
}

// A motion a few degrees off comes back to the one that was found, and scores what that scores.
TEST(TwoViewRansac, DescendsToTheNearestMinimum) {
  Rng rng(17);
  TwoViewRansac ransac(300);
  const TwoViewScene scene =
      MakeTwoViewScene(rng, Shape::kBox, 300, Eigen::Vector3d(0.4, 0.1, -0.2), 0.2, kHalfPixelRad);
  TwoViewRansac::Estimate estimate;
  ASSERT_TRUE(ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate));
  const double score = EpipolarScore(estimate.b_from_a, scene.a, scene.b, scene.tolerance);
  EXPECT_NEAR(score, estimate.score, 1e-6);
  SE3 scaled = estimate.b_from_a;
  scaled.translation *= 7.0;
  EXPECT_NEAR(EpipolarScore(scaled, scene.a, scene.b, scene.tolerance), score, 1e-6) << "the unit is not asked for";

  SE3 moved = scene.b_from_a;
  moved.translation += Eigen::Vector3d(0.02, -0.02, 0.02);
  const double moved_score = EpipolarScore(moved, scene.a, scene.b, scene.tolerance);
  EXPECT_LT(moved_score, score - 1.0);
  EXPECT_NEAR(ransac.Descend(&moved), score, 0.05);
  EXPECT_LT(TranslationAngle(moved, estimate.b_from_a), 0.5 * kDegree);
  EXPECT_NEAR(moved.translation.norm(), 1.0, 1e-12);
}

TEST(TwoViewRansac, InliersAreMostTrueMatchesAndFewOthers) {
  Rng rng(5);
  TwoViewRansac ransac(300);
  for (int trial = 0; trial < 30; ++trial) {
    const TwoViewScene scene =
        MakeTwoViewScene(rng, Shape::kTube, 300, Eigen::Vector3d(0.3, 0.1, -0.2), 0.3, kHalfPixelRad);
    TwoViewRansac::Estimate estimate;
    ASSERT_TRUE(ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate));
    int true_found = 0;
    for (int i = 0; i < scene.num_true; ++i) true_found += ransac.inliers()[i];
    EXPECT_GE(true_found, scene.num_true * 80 / 100);  // 95 % less what lies near the epipole
    EXPECT_LE(estimate.num_inliers - true_found, 15);  // an epipolar line leaves a strip where chance may fall
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 1), estimate.num_inliers);
  }
}

TEST(TwoViewRansac, PureRotationIsRefused) {
  Rng rng(6);
  TwoViewRansac ransac(300);
  for (int trial = 0; trial < kScenes / 2; ++trial) {
    const TwoViewScene scene = MakeTwoViewScene(rng, Shape::kBox, 250, Eigen::Vector3d::Zero(), 0.1, kHalfPixelRad);
    TwoViewRansac::Estimate estimate;
    EXPECT_FALSE(ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate));
  }
}

// A motion that is too small is not the same as none that explains the matches: its views are good.
TEST(TwoViewRansac, TellsHowManyMatchesAStillSceneExplains) {
  Rng rng(64);
  TwoViewRansac ransac(300);
  TwoViewRansac::Estimate estimate;
  for (int trial = 0; trial < test::Trials(20); ++trial) {
    for (const double step : {0.0, 0.002}) {
      const TwoViewScene still =
          MakeTwoViewScene(rng, Shape::kTube, 250, step * Eigen::Vector3d::UnitX(), 0.3, kHalfPixelRad);
      EXPECT_FALSE(ransac.Run(still.a, still.b, still.tolerance, {}, rng, &estimate));
      EXPECT_NEAR(ransac.num_still(), still.num_true, 0.1 * still.num_true);
    }
    const TwoViewScene moved =
        MakeTwoViewScene(rng, Shape::kTube, 250, 0.4 * Eigen::Vector3d::UnitX(), 0.3, kHalfPixelRad);
    EXPECT_TRUE(ransac.Run(moved.a, moved.b, moved.tolerance, {}, rng, &estimate));
    EXPECT_EQ(ransac.num_still(), 0);
    const TwoViewScene random =
        MakeTwoViewScene(rng, Shape::kTube, 250, 0.4 * Eigen::Vector3d::UnitX(), 1.0, kHalfPixelRad);
    EXPECT_FALSE(ransac.Run(random.a, random.b, random.tolerance, {}, rng, &estimate));
    EXPECT_EQ(ransac.num_still(), 0);
  }
}

TEST(TwoViewRansac, PlaneIsSolvedOrRefusedButNotMistaken) {
  // A plane has two explanations, both often with all points in front: which of them fits better is noise.
  Rng rng(7);
  TwoViewRansac ransac(300);
  int solved = 0, mistaken = 0;
  for (int trial = 0; trial < kScenes; ++trial) {
    const TwoViewScene scene =
        MakeTwoViewScene(rng, Shape::kPlane, 200, Eigen::Vector3d(0.5, 0.2, 0.1), 0.1, 0.3 * kHalfPixelRad);
    TwoViewRansac::Estimate estimate;
    if (!ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate)) continue;
    ++(TranslationAngle(estimate.b_from_a, scene.b_from_a) < 5.0 * kDegree ? solved : mistaken);
  }
  EXPECT_GE(solved, kScenes * 30 / 100);
  EXPECT_LE(mistaken, kScenes * 2 / 100);
}

// Two motions explain a plane alike, so neither is taken, and the caller hears why.
TEST(TwoViewRansac, PlaneHasARival) {
  Rng rng(18);
  TwoViewRansac ransac(300);
  int num_refused = 0, num_rivals = 0;
  for (int trial = 0; trial < kScenes / 2; ++trial) {
    const TwoViewScene scene =
        MakeTwoViewScene(rng, Shape::kPlane, 200, Eigen::Vector3d(0.5, 0.2, 0.1), 0.1, 0.3 * kHalfPixelRad);
    TwoViewRansac::Estimate estimate;
    const bool found = ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate);
    EXPECT_FALSE(found && ransac.has_rival());
    if (found) continue;
    ++num_refused;
    num_rivals += ransac.has_rival() ? 1 : 0;
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 1), 0);
  }
  ASSERT_GT(num_refused, kScenes / 10);
  EXPECT_GE(num_rivals, num_refused * 9 / 10);
  TwoViewRansac::Estimate estimate;
  const TwoViewScene still = MakeTwoViewScene(rng, Shape::kBox, 200, Eigen::Vector3d::Zero(), 0.1, kHalfPixelRad);
  EXPECT_FALSE(ransac.Run(still.a, still.b, still.tolerance, {}, rng, &estimate));
  EXPECT_FALSE(ransac.has_rival());  // a scope that only turned has no motion to choose
}

// A short baseline among many false matches: samples alone end in this minimum or in that one.
TEST(TwoViewRansac, LowestMinimumIsFoundWhateverTheSeed) {
  Rng scene_rng(19);
  TwoViewRansac ransac(300);
  TwoViewRansac::Options options;
  options.max_runner_up_share = 0.99;
  options.min_moving_share = 0.0;
  int num_scenes = 0, num_alike = 0;
  for (int trial = 0; trial < kScenes / 8; ++trial) {
    const TwoViewScene scene =
        MakeTwoViewScene(scene_rng, Shape::kBox, 200, Eigen::Vector3d(0.06, 0.02, 0.0), 0.4, kHalfPixelRad);
    double least = std::numeric_limits<double>::infinity(), most = 0.0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      Rng rng(seed);
      TwoViewRansac::Estimate estimate;
      if (!ransac.Run(scene.a, scene.b, scene.tolerance, options, rng, &estimate)) continue;
      least = std::min(least, estimate.score);
      most = std::max(most, estimate.score);
    }
    if (most == 0.0) continue;
    ++num_scenes;
    num_alike += most - least < 4.0 ? 1 : 0;
  }
  ASSERT_GT(num_scenes, kScenes / 10);
  EXPECT_GE(num_alike, num_scenes * 80 / 100);
}

TEST(TwoViewRansac, SlightlyCurvedWallIsSolved) {
  // Folds of a tenth of the distance are enough to tell the two explanations of the plane apart.
  Rng rng(17);
  TwoViewRansac ransac(300);
  int solved = 0;
  for (int trial = 0; trial < kScenes / 2; ++trial) {
    TwoViewScene scene = MakeTwoViewScene(rng, Shape::kPlane, 200, Eigen::Vector3d(0.5, 0.2, 0.1), 0.0, 0.0);
    for (int i = 0; i < 200; ++i) {
      scene.points[i].z() += 0.3 * std::sin(3.0 * scene.points[i].x());
      scene.a[i] = test::NoisyBearing(rng, scene.points[i].normalized(), kHalfPixelRad);
      scene.b[i] = test::NoisyBearing(rng, (scene.b_from_a * scene.points[i]).normalized(), kHalfPixelRad);
    }
    TwoViewRansac::Estimate estimate;
    if (!ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate)) continue;
    if (TranslationAngle(estimate.b_from_a, scene.b_from_a) < 5.0 * kDegree) ++solved;
  }
  EXPECT_GE(solved, kScenes / 2 * 99 / 100);
}

// The direction's error over trials is what direction_sigma_rad says, whatever the number and the depth of the points.
TEST(TwoViewRansac, DirectionSigmaIsTheSpreadOfTheDirection) {
  Rng rng(11);
  TwoViewRansac ransac(300);
  constexpr int kTrials = std::max(kScenes, 100);  // of fewer the spread itself is not known well enough
  for (const auto& [shape, count, baseline] :
       {std::tuple{Shape::kBox, 250, 0.4}, {Shape::kBox, 60, 0.4}, {Shape::kBox, 250, 0.1}, {Shape::kTube, 250, 0.2}}) {
    double error2 = 0.0, sigma2 = 0.0;
    int num_runs = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      const Eigen::Vector3d sideways(rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-0.5, 0.5));
      const TwoViewScene scene =
          MakeTwoViewScene(rng, shape, count, baseline * sideways.normalized(), 0.0, kHalfPixelRad);
      TwoViewRansac::Estimate estimate;
      if (!ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate)) continue;
      ++num_runs;
      error2 += std::pow(TranslationAngle(estimate.b_from_a, scene.b_from_a), 2);
      sigma2 += std::pow(estimate.direction_sigma_rad, 2);
    }
    ASSERT_GT(num_runs, kTrials / 2);
    // The sigma is that of the worst axis; the other one adds between nothing and as much again. The noise of
    // NoisyBearing is that of one bearing along each axis, as the tolerances take it to be.
    const double ratio = std::sqrt(error2 / sigma2);
    EXPECT_GT(ratio, 0.7) << count << " matches, baseline " << baseline;
    EXPECT_LT(ratio, 1.7) << count << " matches, baseline " << baseline;
  }
}

TEST(TwoViewRansac, NoiseRatioTellsWhatTheMotionLeavesUnexplained) {
  Rng rng(12);
  TwoViewRansac ransac(300);
  const auto mean_ratio = [&](double outlier_share, double sigma_rad) {
    double sum = 0.0;
    for (int trial = 0; trial < 20; ++trial) {
      const TwoViewScene scene =
          MakeTwoViewScene(rng, Shape::kBox, 300, Eigen::Vector3d(0.4, 0.1, -0.1), outlier_share, sigma_rad);
      TwoViewRansac::Estimate estimate;
      EXPECT_TRUE(ransac.Run(scene.a, scene.b, scene.tolerance, {}, rng, &estimate));
      sum += estimate.noise_ratio;
    }
    return sum / 20;
  };
  EXPECT_NEAR(mean_ratio(0.0, kHalfPixelRad), 1.0, 0.1);
  EXPECT_EQ(mean_ratio(0.0, 0.2 * kHalfPixelRad), 1.0);  // never below what the tolerances say
  EXPECT_NEAR(mean_ratio(0.0, 1.5 * kHalfPixelRad), 1.5, 0.15);
  EXPECT_GT(mean_ratio(0.4, kHalfPixelRad), 1.5);
}

TEST(TwoViewRansac, UselessInputIsRefusedAndOutputsAreKept) {
  Rng rng(8);
  TwoViewRansac ransac(100);
  TwoViewRansac::Estimate estimate;
  estimate.num_inliers = -1;
  const auto expect_refused = [&](const auto& a, const auto& b, const auto& tolerance) {
    EXPECT_FALSE(ransac.Run(a, b, tolerance, {}, rng, &estimate));
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 1), 0);
    EXPECT_EQ(estimate.num_inliers, -1);
  };
  const std::vector<Eigen::Vector3d> none;
  expect_refused(none, none, std::vector<double>());
  const Eigen::Vector3d motion(0.4, 0.1, -0.2);
  const TwoViewScene few = MakeTwoViewScene(rng, Shape::kBox, 19, motion, 0.0, kHalfPixelRad);
  expect_refused(few.a, few.b, few.tolerance);
  const TwoViewScene large = MakeTwoViewScene(rng, Shape::kBox, 101, motion, 0.0, kHalfPixelRad);
  expect_refused(large.a, large.b, large.tolerance);
  const TwoViewScene good = MakeTwoViewScene(rng, Shape::kBox, 100, motion, 0.0, kHalfPixelRad);
  expect_refused(good.a, few.b, good.tolerance);
  const TwoViewScene chance = MakeTwoViewScene(rng, Shape::kBox, 100, motion, 1.0, kHalfPixelRad);
  expect_refused(chance.a, chance.b, chance.tolerance);
  expect_refused(good.a, good.a, good.tolerance);  // nothing moved
  const std::vector<Eigen::Vector3d> one_place(100, Eigen::Vector3d(0, 0, 1));
  expect_refused(one_place, one_place, good.tolerance);
  // Points on a line in space.
  std::vector<Eigen::Vector3d> line_a(100), line_b(100);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d point(0.04 * i - 2.0, 0.3, 3.0);
    line_a[i] = point.normalized();
    line_b[i] = (point + motion).normalized();
  }
  expect_refused(line_a, line_b, good.tolerance);
}

TEST(TwoViewRansac, SameSeedGivesTheSameBits) {
  Rng scene_rng(9);
  const TwoViewScene scene =
      MakeTwoViewScene(scene_rng, Shape::kTube, 250, Eigen::Vector3d(0.3, 0.1, -0.2), 0.3, kHalfPixelRad);
  TwoViewRansac used(500), fresh(250);
  TwoViewRansac::Estimate first, second;
  Rng warm_up(1), a(77), b(77);
  ASSERT_TRUE(used.Run(scene.a, scene.b, scene.tolerance, {}, warm_up, &first));
  ASSERT_TRUE(used.Run(scene.a, scene.b, scene.tolerance, {}, a, &first));
  ASSERT_TRUE(fresh.Run(scene.a, scene.b, scene.tolerance, {}, b, &second));
  EXPECT_EQ(first.b_from_a.rotation.coeffs(), second.b_from_a.rotation.coeffs());
  EXPECT_EQ(first.b_from_a.translation, second.b_from_a.translation);
  EXPECT_EQ(first.score, second.score);
  EXPECT_TRUE(std::equal(used.inliers().begin(), used.inliers().end(), fresh.inliers().begin()));
}

TEST(TwoViewRansac, RunNeverAllocates) {
  if (!test::AllocationCounter::IsAvailable()) GTEST_SKIP() << "the sanitizer owns malloc";
  Rng rng(10);
  const TwoViewScene scene =
      MakeTwoViewScene(rng, Shape::kTube, 250, Eigen::Vector3d(0.3, 0.1, -0.2), 0.3, kHalfPixelRad);
  TwoViewRansac ransac(250);
  TwoViewRansac::Estimate estimate;
  const test::AllocationCounter counter;
  TwoViewRansac::Options options;
  options.should_stop = [&counter] { return counter.count() > 0; };
  const bool found = ransac.Run(scene.a, scene.b, scene.tolerance, options, rng, &estimate);
  EXPECT_EQ(counter.count(), 0u);
  EXPECT_TRUE(found);
}

// At whichever question the caller says so: before a trial, or before the end.
TEST(TwoViewRansac, StopsWhenItIsToldAndKeepsItsOutputs) {
  Rng scene_rng(11);
  const TwoViewScene scene =
      MakeTwoViewScene(scene_rng, Shape::kTube, 250, Eigen::Vector3d(0.3, 0.1, -0.2), 0.3, kHalfPixelRad);
  TwoViewRansac ransac(250);
  int num_asked = 0, stop_at = 0;
  TwoViewRansac::Options options;
  options.should_stop = [&] { return ++num_asked == stop_at; };
  TwoViewRansac::Estimate estimate;
  Rng rng(12);
  ASSERT_TRUE(ransac.Run(scene.a, scene.b, scene.tolerance, options, rng, &estimate));
  const int num_questions = num_asked;
  ASSERT_GE(num_questions, 3);
  for (stop_at = 1; stop_at <= num_questions; ++stop_at) {
    num_asked = 0;
    estimate.num_inliers = -7;
    Rng again(12);
    EXPECT_FALSE(ransac.Run(scene.a, scene.b, scene.tolerance, options, again, &estimate)) << stop_at;
    EXPECT_EQ(num_asked, stop_at);
    EXPECT_EQ(estimate.num_inliers, -7);
    EXPECT_EQ(std::count(ransac.inliers().begin(), ransac.inliers().end(), 0), 250);
  }
}

}  // namespace
}  // namespace haustra
