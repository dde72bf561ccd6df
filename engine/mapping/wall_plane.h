// Planes through the points of the wall around a ray, and the edge at which one wall ends before another. Plain
// functions of what they are given.
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
// Fewer do not make a wall.
inline constexpr std::size_t kMinWallWitnesses = 6;

// Bit i: witness i.
using WallMembers = std::uint64_t;

struct WallPlane {
  Eigen::Vector3d m = Eigen::Vector3d::UnitX();
  double cost = 0.0;  // of its members' residuals: at most the sum of their weights
};

struct WallSide {
  WallPlane plane;
  WallMembers members = 0;
};

// The plane of the wall that the pixel shows: through all witnesses, or through those on the pixel's side of a straight
// edge, where two planes explain them clearly better than one. The nearer wall ends overhang_px before its last
// witness. Witnesses are sorted by their inverse distance; kMinWallWitnesses to kMaxWallWitnesses of them.
WallSide FitWallSide(const std::vector<WallWitness>& witnesses, double overhang_px);

}  // namespace haustra
