#include "engine/geometry/triangulation.h"

#include <cmath>

namespace haustra {
namespace {

constexpr double kMinParallaxRad = 1e-5;

}  // namespace

bool TriangulateBearings(const SE3& b_from_a, const Eigen::Vector3d& bearing_a, const Eigen::Vector3d& bearing_b,
                         Triangulated* out) {
  const double baseline = b_from_a.translation.norm();
  if (!(baseline > 0.0)) return false;
  const Eigen::Vector3d t = b_from_a.translation / baseline;
  const Eigen::Vector3d ray_a = b_from_a.rotation * bearing_a;  // in the axes of b

  // Normal of the epipolar plane: the direction orthogonal to t that is least aligned with both rays, the smaller
  // eigenvector of a 2x2 matrix in a basis (u, v) of the plane orthogonal to t.
  const Eigen::Vector3d u = t.unitOrthogonal();
  const Eigen::Vector3d v = t.cross(u);
  const double au = ray_a.dot(u), av = ray_a.dot(v), bu = bearing_b.dot(u), bv = bearing_b.dot(v);
  const double m00 = au * au + bu * bu, m01 = au * av + bu * bv, m11 = av * av + bv * bv;
  const double half_angle = 0.5 * std::atan2(2.0 * m01, m00 - m11);  // of the larger eigenvector
  const Eigen::Vector3d normal = -std::sin(half_angle) * u + std::cos(half_angle) * v;

  const Eigen::Vector3d a = (ray_a - ray_a.dot(normal) * normal).normalized();
  const Eigen::Vector3d b = (bearing_b - bearing_b.dot(normal) * normal).normalized();
  // depth_b * b = depth_a * a + t, all in one plane; signed areas along the normal.
  const double sine = b.cross(a).dot(normal);
  if (!(std::abs(sine) > kMinParallaxRad)) return false;
  const double depth_a = t.cross(b).dot(normal) / sine;
  const double depth_b = t.cross(a).dot(normal) / sine;
  if (!(depth_a > 0.0) || !(depth_b > 0.0)) return false;
  out->point_in_a = baseline * depth_a * (b_from_a.rotation.conjugate() * a);
  out->cos_parallax = a.dot(b);
  return true;
}

}  // namespace haustra
