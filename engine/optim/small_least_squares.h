// Levenberg-Marquardt for problems of a few unknowns on a manifold, without heap, and the robust cost that goes with
// it. Shared by pose_optimizer.cc and sim3_optimizer.cc. reentrant, rt-safe.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace haustra {

// Geman and McClure's cost c^2 chi2 / (c^2 + chi2) of a squared error. It levels off at c^2, where Huber's goes on
// rising: a point that was triangulated wrongly just in front of the camera moves by hundreds of pixels for a small
// step of the pose, and with Huber one such point outweighs a hundred good ones. An observation that cannot be seen has
// an infinite error and costs c^2.
class GemanMcClure {
 public:
  explicit GemanMcClure(double scale2) : scale2_(scale2) {}

  double Cost(double chi2) const { return chi2 < kFar ? scale2_ * chi2 / (scale2_ + chi2) : scale2_; }
  // Derivative of the cost by the squared error: the weight of the observation in the normal equations.
  double Weight(double chi2) const {
    const double ratio = scale2_ / (scale2_ + chi2);
    return ratio * ratio;
  }

 private:
  static constexpr double kFar = 1e100;
  double scale2_;
};

// Running quantile of squared errors over many orders of magnitude, in fixed memory: counts in bins of a quarter
// octave, so that the answer is right to 9 % of the error itself.
class Chi2Histogram {
 public:
  // Infinite errors count as the largest.
  void Add(double chi2) {
    const double bin = kBinsPerOctave * (std::log2(std::max(kSmallest, chi2)) - std::log2(kSmallest));
    ++counts_[static_cast<std::size_t>(std::clamp(bin, 0.0, static_cast<double>(kBins - 1)))];
    ++total_;
  }
  // Upper end of the bin at which `share` of what was added has been passed.
  double Quantile(double share) const {
    int passed = 0;
    for (int i = 0; i < kBins; ++i) {
      passed += counts_[i];
      if (passed >= share * total_) return kSmallest * std::exp2((i + 1) / static_cast<double>(kBinsPerOctave));
    }
    return kSmallest;
  }

 private:
  static constexpr int kBins = 160, kBinsPerOctave = 4;
  static constexpr double kSmallest = 1.0 / 1024.0;  // up to 2^30: tens of thousands of sigmas
  std::array<int, kBins> counts_{};
  int total_ = 0;
};

// Scale of the robust cost for a round: what the better part of the observations needs at the present estimate, never
// less than the gate.
inline double RobustScale2(const Chi2Histogram& errors, double chi2_gate) {
  // With four in ten true the scale is theirs; three times their largest keeps the true ones in the rising part.
  constexpr double kTrueShare = 0.4, kReserve = 3.0;
  return std::max(chi2_gate, kReserve * errors.Quantile(kTrueShare));
}

// Problem offers, with N unknowns and a `State`:
//   double Linearize(const State&, Matrix<N,N>* hessian, Vector<N>* gradient) const;  returns the cost, sum of squares
//   static State Moved(const State&, const Vector<N>& step);
// Nearly every step is taken: a candidate is linearised at once, and not looked at twice.
// True when it ended by a step that changes nothing any more, false when by the count, by damping, or by a bad number.
template <int N, typename State, typename Problem>
bool MinimizeSmall(const Problem& problem, int iterations, State* state) {
  using Matrix = Eigen::Matrix<double, N, N>;
  using Vector = Eigen::Matrix<double, N, 1>;
  constexpr double kInitialDamping = 1e-4, kMinDamping = 1e-9, kMaxDamping = 1e8;
  // Far below what a pixel can tell.
  constexpr double kSmallStep = 1e-8, kSmallRelativeDecrease = 1e-7;

  Matrix hessian, candidate_hessian;
  Vector gradient, candidate_gradient;
  double damping = kInitialDamping;
  double cost = problem.Linearize(*state, &hessian, &gradient);
  for (int i = 0; i < iterations; ++i) {
    Matrix damped = hessian;
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-12 * std::max(hessian.diagonal().maxCoeff(), 1e-12);
    const Vector step = -damped.ldlt().solve(gradient);
    if (!step.allFinite()) return false;
    const State candidate = Problem::Moved(*state, step);
    const double candidate_cost = problem.Linearize(candidate, &candidate_hessian, &candidate_gradient);
    // Lengths are in map units, whose size is arbitrary: a step is judged by what it is expected to gain.
    const double expected = -2.0 * step.dot(gradient) - step.dot(hessian * step);
    const bool is_small = expected <= kSmallRelativeDecrease * cost || step.norm() < kSmallStep;
    if (candidate_cost <= cost) {
      *state = candidate;
      if (is_small || cost - candidate_cost <= kSmallRelativeDecrease * cost) return true;
      damping = std::max(0.1 * damping, kMinDamping);
      cost = candidate_cost;
      hessian = candidate_hessian;
      gradient = candidate_gradient;
    } else {
      if (is_small) return true;
      damping *= 10.0;
      if (damping > kMaxDamping) return false;
    }
  }
  return false;
}

// Whether the normal equations determine all unknowns, judged after scaling to a unit diagonal: the unknowns have
// different units.
template <int N>
bool IsWellDetermined(const Eigen::Matrix<double, N, N>& information) {
  constexpr double kMaxCondition = 1e14;
  if (!information.allFinite()) return false;
  const Eigen::Matrix<double, N, 1> scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::Matrix<double, N, N> scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::Matrix<double, N, 1> pivots = scaled.ldlt().vectorD();
  return pivots.minCoeff() * kMaxCondition > pivots.maxCoeff();
}

}  // namespace haustra
