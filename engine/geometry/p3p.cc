#include "engine/geometry/p3p.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

// One real root of x^3 + b x^2 + c x + d (Cardano, or the trigonometric form when there are three), polished by Newton.
double RealCubicRoot(double b, double c, double d) {
  const double p = c - b * b / 3.0;
  const double q = (2.0 * b * b / 27.0 - c / 3.0) * b + d;
  const double discriminant = 0.25 * q * q + p * p * p / 27.0;
  double x;
  if (discriminant > 0.0) {
    const double a = -std::copysign(std::cbrt(0.5 * std::abs(q) + std::sqrt(discriminant)), q);
    x = a - (a != 0.0 ? p / (3.0 * a) : 0.0);
  } else {
    const double radius = std::sqrt(std::max(0.0, -p / 3.0));
    const double cosine = radius > 0.0 ? std::clamp(-0.5 * q / (radius * radius * radius), -1.0, 1.0) : 1.0;
    x = 2.0 * radius * std::cos(std::acos(cosine) / 3.0);
  }
  x -= b / 3.0;
  for (int i = 0; i < 3; ++i) {
    const double value = ((x + b) * x + c) * x + d;
    const double slope = (3.0 * x + 2.0 * b) * x + c;
    if (slope == 0.0) break;
    x -= value / slope;
  }
  return x;
}

// Roots of a x^2 + b x + c without cancellation; returns how many are real.
int RealQuadraticRoots(double a, double b, double c, double roots[2]) {
  const double discriminant = b * b - 4.0 * a * c;
  if (discriminant < 0.0) return 0;
  const double q = -0.5 * (b + std::copysign(std::sqrt(discriminant), b));
  int count = 0;
  if (a != 0.0) roots[count++] = q / a;
  if (q != 0.0) roots[count++] = c / q;
  return count;
}

// Depths d with d_i^2 + d_j^2 - 2 cos_ij d_i d_j = length2_ij for the pairs (0,1), (0,2), (1,2): two Newton steps.
void PolishDepths(const Eigen::Vector3d& cosines, const Eigen::Vector3d& lengths2, Eigen::Vector3d* depths) {
  constexpr int kPairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  for (int iteration = 0; iteration < 2; ++iteration) {
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d residual;
    for (int k = 0; k < 3; ++k) {
      const auto [i, j] = kPairs[k];
      const double di = (*depths)[i], dj = (*depths)[j];
      residual[k] = di * di + dj * dj - 2.0 * cosines[k] * di * dj - lengths2[k];
      jacobian(k, i) = 2.0 * (di - cosines[k] * dj);
      jacobian(k, j) = 2.0 * (dj - cosines[k] * di);
    }
    const Eigen::Vector3d step = jacobian.inverse() * residual;
    if (!step.allFinite() || step.norm() > 0.1 * depths->norm()) return;  // near a double root: leave it as it is
    *depths -= step;
  }
}

}  // namespace

int SolveP3P(std::span<const Eigen::Vector3d, 3> bearings, std::span<const Eigen::Vector3d, 3> points_in_world,
             std::array<SE3, 4>* cam_from_world) {
  const Eigen::Vector3d d01 = points_in_world[0] - points_in_world[1];
  const Eigen::Vector3d d02 = points_in_world[0] - points_in_world[2];
  const Eigen::Vector3d d12 = points_in_world[1] - points_in_world[2];
  const Eigen::Vector3d plane_normal = d01.cross(d12);
  const Eigen::Vector3d lengths2(d01.squaredNorm(), d02.squaredNorm(), d12.squaredNorm());
  if (!(plane_normal.squaredNorm() > 1e-10 * lengths2.maxCoeff() * lengths2.maxCoeff())) return 0;
  const Eigen::Vector3d cosines(bearings[0].dot(bearings[1]), bearings[0].dot(bearings[2]),
                                bearings[1].dot(bearings[2]));

  // Depths d satisfy d' M_ij d = length2_ij; two homogeneous combinations remove the right-hand sides.
  Eigen::Matrix3d m01, m02, m12;
  m01 << 1, -cosines[0], 0, -cosines[0], 1, 0, 0, 0, 0;
  m02 << 1, 0, -cosines[1], 0, 0, 0, -cosines[1], 0, 1;
  m12 << 0, 0, 0, 0, 1, -cosines[2], 0, -cosines[2], 1;
  const double unit = 1.0 / lengths2.maxCoeff();
  Eigen::Matrix3d conic1 = unit * (lengths2[2] * m01 - lengths2[0] * m12);
  Eigen::Matrix3d conic2 = unit * (lengths2[2] * m02 - lengths2[1] * m12);

  // det(conic1 + gamma conic2) = 0, with the leading coefficient made the larger end of the polynomial.
  if (std::abs(conic2.determinant()) < std::abs(conic1.determinant())) std::swap(conic1, conic2);
  const double c3 = conic2.determinant();
  if (c3 == 0.0) return 0;
  const auto mixed = [](const Eigen::Matrix3d& single, const Eigen::Matrix3d& pair) {
    return single.col(0).dot(pair.col(1).cross(pair.col(2))) + single.col(1).dot(pair.col(2).cross(pair.col(0))) +
           single.col(2).dot(pair.col(0).cross(pair.col(1)));
  };
  const double gamma = RealCubicRoot(mixed(conic1, conic2) / c3, mixed(conic2, conic1) / c3, conic1.determinant() / c3);
  const Eigen::Matrix3d degenerate = conic1 + gamma * conic2;
  const Eigen::Matrix3d& other = std::abs(gamma) <= 1.0 ? conic2 : conic1;

  // The degenerate conic is a pair of planes through the origin of the space of depths, real when its two eigenvalues
  // have opposite signs (ascending order puts the one that ought to be zero between them).
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.compute(degenerate);
  const double negative = eigen.eigenvalues()[0], positive = eigen.eigenvalues()[2];
  if (!(negative < 0.0) || !(positive > 0.0)) return 0;
  const double ratio = std::sqrt(-negative / positive);

  const Eigen::Matrix3d all_pairs = m01 + m02 + m12;
  const double all_lengths2 = lengths2.sum();
  Eigen::Matrix3d world_triad;
  world_triad << d01, d12, plane_normal;
  const Eigen::Matrix3d world_triad_inverse = world_triad.inverse();

  int count = 0;
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d normal = eigen.eigenvectors().col(2) + sign * ratio * eigen.eigenvectors().col(0);
    // Within the plane one depth is a combination of the other two; the best determined one is eliminated.
    int i = 0;
    normal.cwiseAbs().maxCoeff(&i);
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    Eigen::Vector3d at_j = Eigen::Vector3d::Zero(), at_k = Eigen::Vector3d::Zero();
    at_j[i] = -normal[j] / normal[i];
    at_j[j] = 1.0;
    at_k[i] = -normal[k] / normal[i];
    at_k[k] = 1.0;
    double roots[2];
    const int num_roots =
        RealQuadraticRoots(at_k.dot(other * at_k), 2.0 * at_j.dot(other * at_k), at_j.dot(other * at_j), roots);
    for (int root = 0; root < num_roots && count < 4; ++root) {
      Eigen::Vector3d depths = at_j + roots[root] * at_k;
      const double pairs = depths.dot(all_pairs * depths);
      if (!(pairs > 0.0) || !std::isfinite(pairs)) continue;
      depths *= std::sqrt(all_lengths2 / pairs);
      PolishDepths(cosines, lengths2, &depths);
      if (!(depths.minCoeff() > 0.0)) continue;
      const Eigen::Vector3d p0 = depths[0] * bearings[0], p1 = depths[1] * bearings[1], p2 = depths[2] * bearings[2];
      Eigen::Matrix3d cam_triad;
      cam_triad << p0 - p1, p1 - p2, (p0 - p1).cross(p1 - p2);
      const Eigen::Quaterniond rotation(Eigen::Matrix3d(cam_triad * world_triad_inverse));
      const SE3 pose(rotation, Eigen::Vector3d::Zero());
      (*cam_from_world)[count] = SE3(pose.rotation, p0 - pose.rotation * points_in_world[0]);
      if ((*cam_from_world)[count].rotation.coeffs().allFinite()) ++count;
    }
  }
  return count;
}

}  // namespace haustra
