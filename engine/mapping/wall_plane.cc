#include "engine/mapping/wall_plane.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "hal/core/check.h"

namespace haustra {
namespace {

// Of the distance: points of one wall scatter by 3 to 5 % around it.
constexpr double kDistanceSigma = 0.05;
// Of the slope of the wall against the ray, before anything is measured (tangent of the angle), and how much a witness
// is worth against it.
constexpr double kSlopeSigma = 1.0;
constexpr double kInverseSigma = 0.1;
constexpr int kRounds = 6;
// Orientations of an edge that are tried.
constexpr int kNumEdges = 8;
// Two walls explain so many points, in full weight, that one wall does not. 2 to 4 do equally well, and 0.5 and 1 see
// edges where there are none (decisions/2026-11-28-the-edge-of-a-fold.md).
constexpr double kEdgeGain = 3.0;
// Walls whose distances differ by less are one wall with a bend.
constexpr double kEdgeRatio = 1.1;

bool Has(WallMembers members, std::size_t i) { return (members >> i & 1) != 0; }

// Robust, from the median of the members.
WallPlane FitPlane(const std::vector<WallWitness>& witnesses, WallMembers members) {
  double half = 0.0;
  for (std::size_t i = 0; i < witnesses.size(); ++i) half += Has(members, i) ? 0.5 * witnesses[i].weight : 0.0;
  WallPlane plane;
  for (std::size_t i = 0; i < witnesses.size() && half > 0.0; ++i) {
    if (!Has(members, i)) continue;
    const WallWitness& witness = witnesses[i];
    plane.m.x() = witness.inverse;
    half -= witness.weight;
  }
  const double wish = kInverseSigma * kInverseSigma / (kSlopeSigma * kSlopeSigma);
  for (int round = 0; round < kRounds; ++round) {
    // What is far off at first may be slope.
    const double tolerance = kDistanceSigma * plane.m.x() * std::max(1, 3 - round);
    Eigen::Matrix3d normal_matrix = Eigen::Vector3d(0.0, wish, wish).asDiagonal();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < witnesses.size(); ++i) {
      if (!Has(members, i)) continue;
      const WallWitness& witness = witnesses[i];
      const double residual = (witness.row.dot(plane.m) - witness.inverse) / tolerance;
      const double robust = 1.0 / ((1.0 + residual * residual) * (1.0 + residual * residual));
      normal_matrix += witness.weight * robust * witness.row * witness.row.transpose();
      right_side += witness.weight * robust * witness.inverse * witness.row;
    }
    const Eigen::Vector3d next = normal_matrix.ldlt().solve(right_side);
    if (!next.allFinite() || next.x() <= 0.0) break;
    plane.m = next;
  }
  for (std::size_t i = 0; i < witnesses.size(); ++i) {
    if (!Has(members, i)) continue;
    const WallWitness& witness = witnesses[i];
    const double residual = (witness.row.dot(plane.m) - witness.inverse) / (kDistanceSigma * plane.m.x());
    plane.cost += witness.weight * residual * residual / (1.0 + residual * residual);
  }
  return plane;
}

}  // namespace

WallSide FitWallSide(const std::vector<WallWitness>& witnesses, double overhang_px) {
  const std::size_t num = witnesses.size();
  HAUSTRA_CHECK(num >= kMinWallWitnesses && num <= kMaxWallWitnesses);
  WallSide best;
  best.members = (WallMembers{1} << num) - 1;
  best.plane = FitPlane(witnesses, best.members);
  const WallSide one = best;
  double best_cost = one.plane.cost - kEdgeGain;
  if (best_cost <= 0.0) return one;

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
      const WallMembers beyond = one.members & ~before;
      const WallPlane first = FitPlane(witnesses, before), second = FitPlane(witnesses, beyond);
      const auto [farther, nearer] = std::minmax(first.m.x(), second.m.x());
      if (first.cost + second.cost >= best_cost || nearer <= kEdgeRatio * farther) continue;
      best_cost = first.cost + second.cost;
      const bool is_before_nearer = first.m.x() > second.m.x();
      const double edge_px = is_before_nearer ? along[last] - overhang_px : along[next] + overhang_px;
      // The pixel lies at zero.
      const bool is_beyond = edge_px < 0.0;
      best = is_beyond ? WallSide{second, beyond} : WallSide{first, before};
    }
  }
  return best;
}

}  // namespace haustra
