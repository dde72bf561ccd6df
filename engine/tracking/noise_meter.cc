#include "engine/tracking/noise_meter.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

constexpr double kClassEnds[] = {2.5, 5.0};
// Where the prior is held, whatever was seen: typical scales of the classes.
constexpr double kTypicalScales[] = {1.9, 3.5, 8.0};
// Residuals are counted up to so many sigmas of the prior.
constexpr double kReach = 6.0;
constexpr double kMemorySeconds = 2.0;
constexpr double kPriorWeight = 150.0;  // residuals
constexpr int kIterations = 3;          // a frame; the histograms change little between frames

std::size_t ClassOf(double scale_px) { return scale_px < kClassEnds[0] ? 0 : (scale_px < kClassEnds[1] ? 1 : 2); }

}  // namespace

NoiseMeter::NoiseMeter(const NoiseConfig& prior) : prior_(prior), is_measured_(prior.is_measured), model_(prior) {}

void NoiseMeter::Add(double residual_px, double scale_px) {
  const double bin = residual_px / prior_.SigmaPx(scale_px) * (kBins / kReach);
  if (!(bin < kBins)) return;
  Class& of_scale = classes_[ClassOf(scale_px)];
  of_scale.counts[static_cast<std::size_t>(bin)] += 1.0;
  of_scale.sum_scale += scale_px;
  of_scale.total += 1.0;
}

void NoiseMeter::EndFrame(double seconds_since_last) {
  if (!is_measured_) return;
  for (Class& of_scale : classes_) Estimate(&of_scale);
  FitLine();
  const double kept = std::exp(-std::max(0.0, seconds_since_last) / kMemorySeconds);
  for (Class& of_scale : classes_) {
    for (double& count : of_scale.counts) count *= kept;
    of_scale.sum_scale *= kept;
    of_scale.total *= kept;
  }
}

// Expectation maximisation for core and chance; the core's mean square includes the prior's residuals.
void NoiseMeter::Estimate(Class* of_scale) const {
  constexpr double kWidth = kReach / kBins;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double variance = of_scale->factor * of_scale->factor;
    double core = 0.0, sum_squares = 0.0;
    for (int i = 0; i < kBins; ++i) {
      const double v = (i + 0.5) * kWidth;
      const double by_core = (1.0 - of_scale->chance) * v / variance * std::exp(-0.5 * v * v / variance);
      const double by_chance = of_scale->chance * 2.0 * v / (kReach * kReach);
      const double true_ones = of_scale->counts[static_cast<std::size_t>(i)] * by_core / (by_core + by_chance);
      core += true_ones;
      sum_squares += true_ones * v * v;
    }
    of_scale->factor =
        std::clamp(std::sqrt(0.5 * (sum_squares + 2.0 * kPriorWeight) / (core + kPriorWeight)), kMinFactor, kMaxFactor);
    of_scale->chance = std::clamp(1.0 - core / std::max(1.0, of_scale->total), 0.01, 0.9);
    of_scale->weight = core;
  }
}

// Least squares over the classes; in each the prior weighs as much as its residuals.
void NoiseMeter::FitLine() {
  double w = 0.0, wl = 0.0, wll = 0.0, ws = 0.0, wls = 0.0;
  const auto add = [&](double weight, double scale, double sigma) {
    w += weight;
    wl += weight * scale;
    wll += weight * scale * scale;
    ws += weight * sigma;
    wls += weight * scale * sigma;
  };
  for (std::size_t i = 0; i < classes_.size(); ++i) {
    const Class& of_scale = classes_[i];
    if (of_scale.total > 0.0) {
      const double scale = of_scale.sum_scale / of_scale.total;
      add(of_scale.weight, scale, of_scale.factor * prior_.SigmaPx(scale));
    }
    add(kPriorWeight, kTypicalScales[i], prior_.SigmaPx(kTypicalScales[i]));
  }
  const double determinant = w * wll - wl * wl;
  const double k = (w * wls - wl * ws) / determinant;
  model_.k = std::clamp(k, kMinFactor * prior_.k, kMaxFactor * prior_.k);
  model_.sigma_0_px =
      std::clamp((ws - model_.k * wl) / w, kMinFactor * prior_.sigma_0_px, kMaxFactor * prior_.sigma_0_px);
}

}  // namespace haustra
