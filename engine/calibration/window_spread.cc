#include "engine/calibration/window_spread.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace haustra::calibration {
namespace {

constexpr double kMaxPull = 5.0;   // that one window adds to the common measure
constexpr double kFreePull = 1.5;  // times the usual one: no weight is lost up to here
// Neighbouring windows have half of their views in common (window_collector.h): the sum over windows counts everything
// twice, and the jackknife half of what it should.
constexpr double kShareOfViews = 0.5;

}  // namespace

void WeighWindows(const IntrinsicPrior& prior, const Intrinsics& intrinsics, std::vector<AdjustedWindow>* windows) {
  // How far a window alone would move the intrinsics, in its own standard deviations, a degree of freedom.
  std::vector<double> pulls(windows->size(), 0.0), sorted;
  double sum = 0.0;
  for (std::size_t i = 0; i < windows->size(); ++i) {
    const AdjustedWindow& w = (*windows)[i];
    if (w.weight <= 0.0) continue;
    IntrinsicMatrix information = w.information / w.weight;
    const IntrinsicVector gradient = w.gradient / w.weight;
    IntrinsicVector of_prior = IntrinsicVector::Zero();
    prior.AddTo(intrinsics, &information, &of_prior);
    const double chi2 = gradient.dot(information.ldlt().solve(gradient));
    pulls[i] = std::sqrt(std::max(0.0, chi2 / static_cast<double>(kNumIntrinsics)));
    sorted.push_back(pulls[i]);
    sum += std::min(pulls[i] * pulls[i], kMaxPull * kMaxPull);
  }
  if (sorted.empty()) return;
  const double common = 1.0 / std::max(1.0, sum / static_cast<double>(sorted.size()));
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double usual = std::max(1.0, *middle);
  for (std::size_t i = 0; i < windows->size(); ++i) {
    AdjustedWindow& w = (*windows)[i];
    if (w.weight > 0.0) w.weight = kShareOfViews * common * std::min(1.0, kFreePull * usual / std::max(1e-9, pulls[i]));
  }
}

IntrinsicVector SpreadOf(const IntrinsicPrior& prior, const Intrinsics& intrinsics,
                         const std::vector<AdjustedWindow>& windows) {
  IntrinsicMatrix total = IntrinsicMatrix::Zero();
  IntrinsicVector of_prior = IntrinsicVector::Zero();
  prior.AddTo(intrinsics, &total, &of_prior);
  for (const AdjustedWindow& w : windows) total += w.information;
  std::vector<IntrinsicVector> shifts;
  IntrinsicVector mean = IntrinsicVector::Zero();
  for (const AdjustedWindow& w : windows) {
    if (w.weight <= 0.0) continue;
    shifts.push_back((total - w.information).ldlt().solve(w.gradient));
    mean += shifts.back();
  }
  const auto num = static_cast<double>(std::max<std::size_t>(1, shifts.size()));
  mean /= num;
  IntrinsicVector jackknife = IntrinsicVector::Zero();
  for (const IntrinsicVector& shift : shifts)
    jackknife += (shift - mean).cwiseAbs2() * ((num - 1.0) / num / kShareOfViews);
  const IntrinsicVector formal = total.inverse().diagonal();
  return formal.cwiseMax(jackknife).cwiseMax(0.0).cwiseSqrt();
}

}  // namespace haustra::calibration
