#include "engine/mapping/wall_plane.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "hal/core/check.h"

namespace haustra {
namespace {

// Sigmas of a slope are of the wall against the ray, before anything is measured (tangent of the angle).
constexpr double kWideSlopeSigma = 2.0;
constexpr int kWideRounds = 8;
// A share of the distance. With 0.05 points of steep walls are outliers, and marks on them are not found again.
constexpr double kNarrowTolerance = 0.07;
constexpr double kNarrowSlopeSigma = 1.0;
constexpr int kNarrowRounds = 6;
// How much a witness is worth against the wish for a wall that faces the camera.
constexpr double kInverseSigma = 0.1;
// The wide plane leaves less of the cost by this factor where the wall is a slope. Where both do equally well, it
// bridges an edge.
constexpr double kSlopeGain = 1.1;
// Two walls explain so many points, in full weight, that one does not. With 2 and 4 as many pixels of rendered colons
// are wrong, within 0.2 %.
constexpr double kEdgeGain = 3.0;
// Walls whose distances differ by less are one wall with a bend.
constexpr double kEdgeRatio = 1.1;
// Orientations of an edge that are tried.
constexpr int kNumEdges = 8;

WallMembers FirstMembers(std::size_t num) { return (WallMembers{1} << num) - 1; }

class PlaneFit {
 public:
  explicit PlaneFit(const std::vector<WallWitness>& witnesses) : witnesses_(witnesses) {
    std::iota(by_inverse_.begin(), by_inverse_.end(), std::size_t{0});
    std::sort(by_inverse_.begin(), by_inverse_.begin() + static_cast<std::ptrdiff_t>(witnesses.size()),
              [&](std::size_t a, std::size_t b) { return witnesses[a].inverse < witnesses[b].inverse; });
  }

  // Begins at the usual distance, with tolerances that a steep slope stays within.
  WallPlane Wide(WallMembers members) const {
    WallPlane plane;
    plane.members = members;
    for (int round = 0; round < kWideRounds; ++round) {
      const double tolerance = kWallTolerance * std::max(1.0, 3.0 - round);
      if (!Improve(tolerance, kWideSlopeSigma, &plane)) break;
    }
    return plane;
  }

  // Begins at the members' median distance, and stays with those near it.
  WallPlane Narrow(WallMembers members) const {
    WallPlane plane;
    plane.members = members;
    plane.m.x() = MedianInverse(members);
    for (int round = 0; round < kNarrowRounds; ++round) {
      const double tolerance = kNarrowTolerance * plane.m.x() * std::max(1.0, 3.0 - round);
      if (!Improve(tolerance, kNarrowSlopeSigma, &plane)) break;
    }
    plane.cost = Cost(plane.m, members);
    return plane;
  }

  double Cost(const Eigen::Vector3d& m, WallMembers members) const {
    double cost = 0.0;
    for (std::size_t i = 0; i < witnesses_.size(); ++i) {
      if (!IsMember(members, i)) continue;
      const WallWitness& witness = witnesses_[i];
      const double residual = (witness.row.dot(m) - witness.inverse) / (kNarrowTolerance * m.x());
      cost += witness.weight * residual * residual / (1.0 + residual * residual);
    }
    return cost;
  }

 private:
  // By weight.
  double MedianInverse(WallMembers members) const {
    double half = 0.0, inverse = 1.0;
    for (std::size_t i = 0; i < witnesses_.size(); ++i) half += IsMember(members, i) ? 0.5 * witnesses_[i].weight : 0.0;
    for (std::size_t k = 0; k < witnesses_.size() && half > 0.0; ++k) {
      const WallWitness& witness = witnesses_[by_inverse_[k]];
      if (!IsMember(members, by_inverse_[k])) continue;
      inverse = witness.inverse;
      half -= witness.weight;
    }
    return inverse;
  }

  // A round of reweighted least squares with a weak wish for a wall that faces the camera.
  bool Improve(double tolerance, double slope_sigma, WallPlane* plane) const {
    const double wish = kInverseSigma * kInverseSigma / (slope_sigma * slope_sigma);
    Eigen::Matrix3d normal_matrix = Eigen::Vector3d(0.0, wish, wish).asDiagonal();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < witnesses_.size(); ++i) {
      if (!IsMember(plane->members, i)) continue;
      const WallWitness& witness = witnesses_[i];
      const double residual = (witness.row.dot(plane->m) - witness.inverse) / tolerance;
      const double robust = 1.0 / ((1.0 + residual * residual) * (1.0 + residual * residual));
      const double weight = witness.weight * robust;
      normal_matrix += weight * witness.row * witness.row.transpose();
      right_side += weight * witness.inverse * witness.row;
    }
    const Eigen::Vector3d next = normal_matrix.ldlt().solve(right_side);
    if (!next.allFinite() || next.x() <= 0.0) return false;
    plane->m = next;
    return true;
  }

  const std::vector<WallWitness>& witnesses_;
  std::array<std::size_t, kMaxWallWitnesses> by_inverse_{};
};

// In points. Steep walls are rare, and a plane that bridges an edge is steep.
double SlopeCost(const Eigen::Vector3d& m) {
  return m.tail<2>().squaredNorm() / (kWideSlopeSigma * kWideSlopeSigma * m.x() * m.x());
}

WallPlane FitOnePlane(const PlaneFit& fit, std::size_t num) {
  const WallMembers all = FirstMembers(num);
  const WallPlane narrow = fit.Narrow(all);
  WallPlane wide = fit.Wide(FirstMembers(std::min(num, kMaxWideWitnesses)));
  wide.cost = fit.Cost(wide.m, all);
  return kSlopeGain * wide.cost <= narrow.cost ? wide : narrow;
}

}  // namespace

WallPlane FitWallPlane(const std::vector<WallWitness>& witnesses, double overhang_px) {
  const std::size_t num = witnesses.size();
  HAUSTRA_CHECK(num >= kMinWallWitnesses && num <= kMaxWallWitnesses);
  const PlaneFit fit(witnesses);
  WallPlane best = FitOnePlane(fit, num);
  double best_cost = best.cost + SlopeCost(best.m) - kEdgeGain;
  if (best_cost <= 0.0) return best;

  std::array<double, kMaxWallWitnesses> along{};
  std::array<std::size_t, kMaxWallWitnesses> order{};
  for (int edge = 0; edge < kNumEdges; ++edge) {
    const double angle = std::numbers::pi * edge / kNumEdges;
    const Eigen::Vector2d across(std::cos(angle), std::sin(angle));
    for (std::size_t i = 0; i < num; ++i) {
      along[i] = witnesses[i].offset_px.dot(across);
      order[i] = i;
    }
    std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(num),
              [&](std::size_t a, std::size_t b) { return along[a] != along[b] ? along[a] < along[b] : a < b; });
    WallMembers before = 0;
    for (std::size_t i = 1; i + kMinWallWitnesses <= num; ++i) {
      const std::size_t last = order[i - 1], next = order[i];
      before |= WallMembers{1} << last;
      if (i < kMinWallWitnesses) continue;
      const WallPlane first = fit.Narrow(before), second = fit.Narrow(FirstMembers(num) & ~before);
      const auto [farther, nearer] = std::minmax(first.m.x(), second.m.x());
      const double cost = first.cost + SlopeCost(first.m) + second.cost + SlopeCost(second.m);
      if (cost >= best_cost || nearer <= kEdgeRatio * farther) continue;
      best_cost = cost;
      const bool is_before_nearer = first.m.x() > second.m.x();
      const double edge_px = is_before_nearer ? along[last] - overhang_px : along[next] + overhang_px;
      // The pixel lies at zero.
      best = edge_px < 0.0 ? second : first;
    }
  }
  return best;
}

}  // namespace haustra
