// Planes through the points of the wall around a ray, and the edge at which one wall ends before another. Source: our
// own, by reweighted least squares (engine/mapping/decisions/2026-11-28-the-edge-of-a-fold.md). reentrant; no heap.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace haustra {

// A plane m with m . point = 1 gives 1 / distance = m . (unit ray): linear in m. Its parts are taken along the ray that
// is asked about, and across it twice.
struct WallWitness {
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();  // from the pixel of that ray
  Eigen::Vector3d row = Eigen::Vector3d::Zero();        // the witness's own ray in these parts
  double inverse = 0.0;                                 // of its distance; 1 is usual
  double weight = 0.0;                                  // 0 to 1: how near it is
};

inline constexpr std::size_t kMaxWallWitnesses = 48;
// The nearest ones, which the wide plane asks.
inline constexpr std::size_t kMaxWideWitnesses = 32;
// Fewer do not make a wall.
inline constexpr std::size_t kMinWallWitnesses = 6;
// Distances that differ by less than this share may be of the same wall.
inline constexpr double kWallTolerance = 0.15;

// Bit i: witness i.
using WallMembers = std::uint64_t;
inline bool IsMember(WallMembers members, std::size_t i) { return (members >> i & 1) != 0; }

struct WallPlane {
  Eigen::Vector3d m = Eigen::Vector3d::UnitX();
  WallMembers members = 0;  // who was asked
  double cost = 0.0;        // of their residuals: at most the sum of their weights
};

// The wall that the pixel shows, by kMinWallWitnesses to kMaxWallWitnesses witnesses, nearest ones first. Three answers
// are weighed: a wide plane, which follows a steep slope and bridges edges; a narrow one that faces the camera; and the
// pixel's side of a straight edge between two narrow ones. The nearer of two walls ends overhang_px before its last
// witness.
WallPlane FitWallPlane(const std::vector<WallWitness>& witnesses, double overhang_px);

}  // namespace haustra
