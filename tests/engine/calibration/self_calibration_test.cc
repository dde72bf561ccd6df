// Clips of known cameras, with noise and false matches: what is estimated, how far it says it can be trusted, and what
// is refused.
#include "engine/calibration/self_calibration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/calibration/synthetic_clip.h"

namespace haustra::calibration {
namespace {

// The window of the scope: its centre is a little off that of the camera.
ScopeWindow ScopeOf(const SyntheticCamera& camera) {
  return {0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1), static_cast<double>(camera.width_px),
          static_cast<double>(camera.height_px), false};
}

Result<CalibrationEstimate> Estimate(const SyntheticCamera& camera, const std::vector<FeatureWindow>& windows) {
  CalibrationEstimate estimate = EstimateIntrinsics(windows, ScopeOf(camera), {});
  if (!estimate.verdict.ok()) return estimate.verdict;
  return estimate;
}

double FocalError(const SyntheticCamera& camera, const CalibrationEstimate& estimate) {
  return std::abs(std::log(estimate.intrinsics.focal_px / camera.intrinsics.focal_px));
}

TEST(SelfCalibration, FindsAFisheyeWithinOnePercent) {
  const SyntheticCamera camera = ColonScope();
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Result<CalibrationEstimate> estimate = Estimate(camera, MakeClip(camera, {}, 0.4, 8, seed));
    ASSERT_TRUE(estimate.ok()) << estimate.status().ToString();
    EXPECT_LT(FocalError(camera, *estimate), 0.01) << "seed " << seed;
    EXPECT_NEAR(estimate->intrinsics.cx, camera.intrinsics.cx, 4.0);
    EXPECT_NEAR(estimate->intrinsics.cy, camera.intrinsics.cy, 4.0);
    EXPECT_NEAR(estimate->intrinsics.k1, camera.intrinsics.k1, 0.015);
    EXPECT_EQ(estimate->num_windows, 8);
    // Residuals cover the picture and are those of the noise.
    EXPECT_GT(estimate->coverage, 0.7);
    EXPECT_NEAR(estimate->rms_px, 0.4 * std::sqrt(2.0), 0.15);
    EXPECT_GT(estimate->residuals.size(), 3000u);
  }
}

// A focal length of 0.89 of the width, three standard deviations from what is usual for such a window: a clip that
// moves well is not bent.
TEST(SelfCalibration, FindsARigidScopeWithoutFisheye) {
  const SyntheticCamera camera = RigidScope();
  ScopeWindow scope = ScopeOf(camera);
  scope.is_cut = true;
  const CalibrationEstimate estimate = EstimateIntrinsics(MakeClip(camera, {}, 0.3, 12, 4), scope, {});
  ASSERT_TRUE(estimate.verdict.ok()) << estimate.verdict.ToString();
  EXPECT_LT(FocalError(camera, estimate), 0.02);
}

// Each intrinsic within four of its standard deviations, and those not inflated.
TEST(SelfCalibration, SaysHowFarItCanBeTrusted) {
  const SyntheticCamera camera = ColonScope();
  const IntrinsicVector truth = camera.intrinsics.Vector();
  for (std::uint64_t seed = 11; seed <= 13; ++seed) {
    const Result<CalibrationEstimate> estimate = Estimate(camera, MakeClip(camera, {}, 0.5, 10, seed));
    ASSERT_TRUE(estimate.ok()) << estimate.status().ToString();
    const IntrinsicVector error = estimate->intrinsics.Vector() - truth;
    for (int i = 0; i < kNumIntrinsics; ++i) {
      EXPECT_LT(std::abs(error[i]), 4.0 * estimate->sigma[i]) << "seed " << seed << ", intrinsic " << i;
    }
    EXPECT_LT(estimate->sigma[kLogFocal], 0.01);
  }
}

// Without strains in the adjustment it is 3.4 % short.
TEST(SelfCalibration, ABreathingWallDoesNotBendTheFocalLength) {
  const SyntheticCamera camera = ColonScope();
  SyntheticMotion motion;
  motion.breathing = 0.08;
  const Result<CalibrationEstimate> estimate = Estimate(camera, MakeClip(camera, motion, 0.4, 8, 5));
  ASSERT_TRUE(estimate.ok()) << estimate.status().ToString();
  EXPECT_LT(FocalError(camera, *estimate), 0.02);
}

TEST(SelfCalibration, RepeatsToTheBit) {
  const SyntheticCamera camera = ColonScope();
  const std::vector<FeatureWindow> windows = MakeClip(camera, {}, 0.4, 6, 6);
  const Result<CalibrationEstimate> first = Estimate(camera, windows), second = Estimate(camera, windows);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->intrinsics.Vector(), second->intrinsics.Vector());
  EXPECT_EQ(first->sigma, second->sigma);
}

void ExpectRefusal(const Result<CalibrationEstimate>& estimate, const std::string& word) {
  ASSERT_FALSE(estimate.ok()) << estimate->intrinsics.Vector().transpose() << " +- " << estimate->sigma.transpose();
  EXPECT_EQ(estimate.code(), StatusCode::kFailedPrecondition);
  EXPECT_NE(estimate.status().message().find(word), std::string::npos) << estimate.status().message();
}

TEST(SelfCalibration, RefusesTooFewWindows) {
  const SyntheticCamera camera = ColonScope();
  ExpectRefusal(Estimate(camera, MakeClip(camera, {}, 0.4, 3, 8)), "and 3 can be");
  ExpectRefusal(Estimate(camera, {}), "and 0 can be");
}

TEST(SelfCalibration, RefusesAScopeThatOnlyTurns) {
  const SyntheticCamera camera = ColonScope();
  const SyntheticMotion turning = {.forward = 0.0, .sideways = 0.0, .turn_rad = 0.3};
  ExpectRefusal(Estimate(camera, MakeClip(camera, turning, 0.4, 8, 9)), "reconstructed");
}

TEST(SelfCalibration, RefusesASmallStraightAdvance) {
  const SyntheticCamera camera = ColonScope();
  const SyntheticMotion straight = {.forward = 0.25, .sideways = 0.0, .turn_rad = 0.0};
  ExpectRefusal(Estimate(camera, MakeClip(camera, straight, 0.8, 8, 10)), "focal length");
}

// What is refused is still a guess: within what it says of itself, and not narrower than what was refused.
void ExpectGuess(const SyntheticCamera& camera, const CalibrationEstimate& guess) {
  EXPECT_EQ(guess.verdict.code(), StatusCode::kFailedPrecondition);
  EXPECT_GT(guess.sigma[kLogFocal], SelfCalibrationOptions().max_focal_spread);
  EXPECT_LT(FocalError(camera, guess), 2.0 * guess.sigma[kLogFocal]) << guess.intrinsics.Vector().transpose();
  EXPECT_GT(guess.intrinsics.MaxAngle(), 0.5 * camera.width_px / guess.intrinsics.focal_px);
}

TEST(SelfCalibration, GuessesWhatIsUsualWithoutWindows) {
  const SyntheticCamera camera = ColonScope();
  ScopeWindow scope = ScopeOf(camera);
  const CalibrationEstimate whole = EstimateIntrinsics({}, scope, {});
  scope.is_cut = true;
  const CalibrationEstimate cut = EstimateIntrinsics({}, scope, {});
  ExpectGuess(camera, whole);
  ExpectGuess(camera, cut);
  EXPECT_LT(cut.sigma[kLogFocal], whole.sigma[kLogFocal]);
}

// The clip and what is usual together.
TEST(SelfCalibration, GuessesFromAClipThatItRefuses) {
  const SyntheticCamera camera = ColonScope();
  ScopeWindow scope = ScopeOf(camera);
  scope.is_cut = true;
  const SyntheticMotion straight = {.forward = 0.25, .sideways = 0.0, .turn_rad = 0.0};
  const CalibrationEstimate guess = EstimateIntrinsics(MakeClip(camera, straight, 0.8, 8, 10), scope, {});
  ExpectGuess(camera, guess);
  EXPECT_GT(guess.num_windows, 0);
  EXPECT_LE(guess.sigma[kLogFocal], 1.0001 * SelfCalibrationOptions().cut_log_focal_sigma);
}

}  // namespace
}  // namespace haustra::calibration
