// Measures the standard deviation of observations from the residuals of the running map. Points of the last frame are
// searched in a window many sigmas wide, so what they leave after the pose was optimised shows the whole distribution:
// a core of true matches (Rayleigh, two degrees of freedom) and chance matches spread evenly over the window. Both are
// fitted by expectation maximisation to histograms that forget, one for each class of scales, and a line through the
// classes is the model (engine/noise_model.h).
// The prior counts as so many residuals of its own and bounds the result: what is measured never leaves
// [kMinFactor, kMaxFactor] times the prior. thread-bound(tracking); rt-safe, fixed size, deterministic.
#pragma once

#include <array>

#include "engine/noise_model.h"

namespace haustra {

class NoiseMeter {
 public:
  static constexpr double kMinFactor = 0.7;
  static constexpr double kMaxFactor = 3.0;

  explicit NoiseMeter(const NoiseConfig& prior);

  // One match: the distance in pixels between where the map puts its point and where it was found, and the scale at
  // which it was found. Matches further off than the histograms reach are left out.
  void Add(double residual_px, double scale_px);
  // After the matches of a frame: forgets a share of the older ones, by the time passed, and estimates anew.
  void EndFrame(double seconds_since_last);

  const NoiseModel& model() const { return model_; }

 private:
  static constexpr int kBins = 24;
  // By scale: fine, middle, coarse, of about as many keypoints each in real pictures.
  static constexpr int kClasses = 3;
  struct Class {
    std::array<double, kBins> counts{};
    double sum_scale = 0.0;
    double total = 0.0;
    double factor = 1.0;  // of the prior's sigma
    double chance = 0.1;  // share of chance matches
    double weight = 0.0;  // true matches behind the factor
  };

  void Estimate(Class* of_scale) const;
  void FitLine();

  NoiseModel prior_;
  bool is_measured_;
  NoiseModel model_;
  std::array<Class, kClasses> classes_;
};

}  // namespace haustra
