#include "engine/calibration/joint_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "engine/calibration/window_system.h"

namespace haustra::calibration {
namespace {

constexpr double kFirstDamping = 1e-3;
constexpr double kMaxDamping = 1e6;
constexpr double kMinRelativeDecrease = 1e-7;
// For the information of a window: a view or point that nothing holds must not make it singular.
constexpr double kInformationDamping = 1e-7;

NoiseModel NoiseModelOf(const AdjustedWindow& window, const AdjustmentOptions& options) {
  return {window.noise_px, options.loss_width, window.strain_sigma};
}

double TotalCost(const IntrinsicPrior& prior, const AdjustmentOptions& options, const Intrinsics& intrinsics,
                 const std::vector<AdjustedWindow>& windows) {
  double cost = prior.Cost(intrinsics);
  for (const AdjustedWindow& w : windows) {
    if (w.weight <= 0.0) continue;
    cost += w.weight * WindowSystem::Cost(intrinsics, w.reconstruction, NoiseModelOf(w, options));
  }
  return cost;
}

}  // namespace

double IntrinsicPrior::Cost(const Intrinsics& at) const {
  const double excess = at.k2 - k2_per_k1_squared * at.k1 * at.k1;
  IntrinsicVector difference = at.Vector() - mean.Vector();
  difference[kK2] = excess;
  return 0.5 * difference.cwiseQuotient(sigma).squaredNorm();
}

void IntrinsicPrior::AddTo(const Intrinsics& at, IntrinsicMatrix* information, IntrinsicVector* gradient) const {
  const IntrinsicVector difference = at.Vector() - mean.Vector();
  for (int i = 0; i < kK2; ++i) {
    const double weight = 1.0 / (sigma[i] * sigma[i]);
    (*information)(i, i) += weight;
    (*gradient)[i] += weight * difference[i];
  }
  IntrinsicVector row = IntrinsicVector::Zero();
  row[kK2] = 1.0 / sigma[kK2];
  row[kK1] = -2.0 * k2_per_k1_squared * at.k1 / sigma[kK2];
  const double excess = (at.k2 - k2_per_k1_squared * at.k1 * at.k1) / sigma[kK2];
  *information += row * row.transpose();
  *gradient += row * excess;
}

AdjustmentSummary AdjustJointly(const IntrinsicPrior& prior, const AdjustmentOptions& options, Intrinsics* intrinsics,
                                std::vector<AdjustedWindow>* windows) {
  AdjustmentSummary summary;
  double cost = summary.initial_cost = TotalCost(prior, options, *intrinsics, *windows);
  if (!std::isfinite(cost)) return summary;
  std::vector<WindowSystem> systems(windows->size());
  std::vector<Reconstruction> candidates(windows->size());
  double damping = kFirstDamping;
  for (bool must_linearise = true; summary.iterations < options.max_iterations; ++summary.iterations) {
    IntrinsicMatrix information = IntrinsicMatrix::Zero();
    IntrinsicVector gradient = IntrinsicVector::Zero();
    prior.AddTo(*intrinsics, &information, &gradient);
    bool is_solved = true;
    for (std::size_t i = 0; i < windows->size() && is_solved; ++i) {
      const AdjustedWindow& w = (*windows)[i];
      if (w.weight <= 0.0) continue;
      if (must_linearise) systems[i].Linearise(*intrinsics, w.reconstruction, NoiseModelOf(w, options));
      IntrinsicMatrix part;
      IntrinsicVector part_gradient;
      is_solved = systems[i].Reduce(damping, &part, &part_gradient);
      information += w.weight * part;
      gradient += w.weight * part_gradient;
    }
    must_linearise = false;
    if (is_solved) {
      for (int i = 0; i < kNumIntrinsics; ++i) information(i, i) *= 1.0 + damping;
      const IntrinsicVector step = information.ldlt().solve(-gradient);
      const Intrinsics candidate = intrinsics->Plus(step);
      double candidate_cost = prior.Cost(candidate);
      for (std::size_t i = 0; i < windows->size(); ++i) {
        const AdjustedWindow& w = (*windows)[i];
        if (w.weight <= 0.0) continue;
        systems[i].Step(step, w.reconstruction, &candidates[i]);
        SettlePoints(candidate, NoiseModelOf(w, options), &candidates[i]);
        candidate_cost += w.weight * WindowSystem::Cost(candidate, candidates[i], NoiseModelOf(w, options));
      }
      if (candidate_cost < cost) {
        const double decrease = (cost - candidate_cost) / std::max(cost, 1e-12);
        *intrinsics = candidate;
        for (std::size_t i = 0; i < windows->size(); ++i) {
          if ((*windows)[i].weight > 0.0) std::swap((*windows)[i].reconstruction, candidates[i]);
        }
        cost = candidate_cost;
        damping = std::max(1e-8, damping * 0.1);
        must_linearise = true;
        if (decrease < kMinRelativeDecrease) break;
        continue;
      }
    }
    damping *= 10.0;
    if (damping > kMaxDamping) break;
  }
  summary.final_cost = cost;
  summary.is_usable = std::isfinite(cost);
  for (std::size_t i = 0; i < windows->size(); ++i) {
    AdjustedWindow& w = (*windows)[i];
    w.information.setZero();
    w.gradient.setZero();
    if (w.weight <= 0.0) continue;
    systems[i].Linearise(*intrinsics, w.reconstruction, NoiseModelOf(w, options));
    if (!systems[i].Reduce(kInformationDamping, &w.information, &w.gradient)) {
      w.information.setZero();
      w.gradient.setZero();
      w.weight = 0.0;
    }
    w.mean_square_strain = systems[i].MeanSquareStrain(w.reconstruction);
    w.information *= w.weight;
    w.gradient *= w.weight;
  }
  return summary;
}

double NoiseOf(const Intrinsics& intrinsics, const Reconstruction& reconstruction) {
  std::vector<double> squares;
  for (const PointObservation& o : reconstruction.observations) {
    Eigen::Vector2d pixel;
    if (!intrinsics.Project(PointInCamera(reconstruction, o), &pixel, nullptr, nullptr)) continue;
    squares.push_back((pixel - o.pixel).squaredNorm() / (o.sigma_px * o.sigma_px));
  }
  if (squares.empty()) return 1.0;
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  // Median of chi-square with two degrees of freedom: 1.386. Residuals are smaller than the noise by what the unknowns
  // take up.
  const double num_rows = 2.0 * static_cast<double>(reconstruction.observations.size());
  const double num_unknowns = 3.0 * static_cast<double>(reconstruction.points.size()) +
                              6.0 * static_cast<double>(reconstruction.cam_from_world.size()) - 7.0;
  const double redundancy = std::max(0.1, (num_rows - num_unknowns) / num_rows);
  return std::max(0.02, std::sqrt(*middle / 1.386 / redundancy));
}

}  // namespace haustra::calibration
