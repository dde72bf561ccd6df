#include "engine/tracking/noise_meter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/geometry/rng.h"

namespace haustra::test {
namespace {

constexpr double kFramePeriodSeconds = 0.04;
constexpr int kMatchesPerFrame = 200;
constexpr double kScales[] = {1.8, 2.2, 3.5, 4.5, 7.0, 11.0};

// Frames of matches whose residuals are normal along both axes with a standard deviation of k * scale + sigma_0, and a
// share that lie anywhere within six sigmas of the prior.
void Show(NoiseMeter* meter, const NoiseConfig& prior, double k, double sigma_0_px, double chance_share, int frames) {
  Rng rng(5, 1);
  for (int frame = 0; frame < frames; ++frame) {
    for (int i = 0; i < kMatchesPerFrame; ++i) {
      const double scale = kScales[i % std::size(kScales)];
      double residual = (k * scale + sigma_0_px) * std::sqrt(-2.0 * std::log(1.0 - rng.Uniform(0.0, 1.0)));
      if (rng.Uniform(0.0, 1.0) < chance_share) {
        residual = 6.0 * (prior.k * scale + prior.sigma_0_px) * std::sqrt(rng.Uniform(0.0, 1.0));
      }
      meter->Add(residual, scale);
    }
    meter->EndFrame(kFramePeriodSeconds);
  }
}

TEST(NoiseMeter, StartsFromThePrior) {
  const NoiseConfig prior;
  const NoiseMeter meter(prior);
  EXPECT_EQ(meter.model().k, prior.k);
  EXPECT_EQ(meter.model().sigma_0_px, prior.sigma_0_px);
}

TEST(NoiseMeter, FindsTheNoiseOfTheVideo) {
  const NoiseConfig prior;
  NoiseMeter meter(prior);
  Show(&meter, prior, 0.3, 1.3, 0.0, 200);
  for (const double scale : kScales) {
    EXPECT_NEAR(meter.model().SigmaPx(scale), 0.3 * scale + 1.3, 0.1 * (0.3 * scale + 1.3)) << scale;
  }
}

TEST(NoiseMeter, MatchesByChanceDoNotWidenIt) {
  const NoiseConfig prior;
  NoiseMeter meter(prior);
  Show(&meter, prior, prior.k, prior.sigma_0_px, 0.3, 200);
  for (const double scale : kScales) {
    const double sigma = prior.k * scale + prior.sigma_0_px;
    EXPECT_NEAR(meter.model().SigmaPx(scale), sigma, 0.12 * sigma) << scale;
  }
}

TEST(NoiseMeter, StaysWithinItsBounds) {
  const NoiseConfig prior;
  for (const double factor : {0.01, 100.0}) {
    NoiseMeter meter(prior);
    Show(&meter, prior, factor * prior.k, factor * prior.sigma_0_px, 0.0, 100);
    for (const double scale : kScales) {
      const double ratio = meter.model().SigmaPx(scale) / (prior.k * scale + prior.sigma_0_px);
      EXPECT_GE(ratio, NoiseMeter::kMinFactor - 1e-9);
      EXPECT_LE(ratio, NoiseMeter::kMaxFactor + 1e-9);
    }
  }
}

TEST(NoiseMeter, FollowsAChangeAndForgetsWhatWas) {
  const NoiseConfig prior;
  NoiseMeter meter(prior);
  Show(&meter, prior, 2.0 * prior.k, 2.0 * prior.sigma_0_px, 0.0, 200);
  Show(&meter, prior, prior.k, prior.sigma_0_px, 0.0, 300);
  EXPECT_NEAR(meter.model().SigmaPx(2.0), prior.k * 2.0 + prior.sigma_0_px, 0.12);
}

TEST(NoiseMeter, SwitchedOffKeepsThePrior) {
  NoiseConfig prior;
  prior.is_measured = false;
  NoiseMeter meter(prior);
  Show(&meter, prior, 0.5, 2.0, 0.0, 50);
  EXPECT_EQ(meter.model().k, prior.k);
  EXPECT_EQ(meter.model().sigma_0_px, prior.sigma_0_px);
}

TEST(NoiseMeter, SameMatchesGiveTheSameBits) {
  const NoiseConfig prior;
  NoiseMeter a(prior), b(prior);
  Show(&a, prior, 0.3, 1.3, 0.1, 50);
  Show(&b, prior, 0.3, 1.3, 0.1, 50);
  EXPECT_EQ(a.model().k, b.model().k);
  EXPECT_EQ(a.model().sigma_0_px, b.model().sigma_0_px);
}

}  // namespace
}  // namespace haustra::test
