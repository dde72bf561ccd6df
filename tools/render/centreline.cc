#include "tools/render/centreline.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/se3.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {
namespace {

constexpr double kCentrelineStepMm = 0.25;
constexpr int kMaxAttempts = 64;

// A flexure at its place: curvature = sharpest * cos^2, over a stretch whose integral is the turn.
struct Bend {
  double middle_mm, half_mm, sharpest_per_mm, direction_rad;
  // 0 outside, 1 in the middle.
  double Share(double arc_mm) const {
    const double x = std::abs(arc_mm - middle_mm) / half_mm;
    if (x >= 1.0) return 0.0;
    const double c = std::cos(0.5 * std::numbers::pi * x);
    return c * c;
  }
};

}  // namespace

Centreline::Centreline(const Shape& shape, Rng& rng) : length_mm_(shape.length_mm) {
  double curvature = shape.max_curvature_per_mm;
  for (int attempt = 0; attempt < kMaxAttempts && !Build(shape, curvature, rng); ++attempt) curvature *= 0.95;
}

bool Centreline::Build(const Shape& shape, double max_curvature, Rng& rng) {
  // Two curvature components along the transported normals; wavelengths of 70 to 250 mm.
  const Wander bend_normal(rng, 1.0 / 250.0, 1.0 / 70.0), bend_binormal(rng, 1.0 / 250.0, 1.0 / 70.0);
  const double gain = max_curvature / std::sqrt(2.0) * 1.6;

  // A random attitude at the start: nothing downstream may rely on the axes of the world.
  // (Drawn one by one: the order in which arguments of one call are evaluated is the compiler's.)
  Eigen::Quaterniond attitude;
  for (int i = 0; i < 4; ++i) attitude.coeffs()[i] = rng.Uniform(-1.0, 1.0);
  attitude.normalize();
  Eigen::Vector3d position;
  for (int i = 0; i < 3; ++i) position[i] = rng.Uniform(-50.0, 50.0);

  std::vector<Bend> bends;
  for (const Flexure& flexure : shape.flexures) {
    // The mean of cos^2 is a half: turn = half * sharpest.
    const double turn_rad = flexure.turn_deg * std::numbers::pi / 180.0;
    bends.push_back({flexure.at_share * shape.length_mm, turn_rad * flexure.radius_mm, 1.0 / flexure.radius_mm,
                     rng.Uniform(0.0, 2.0 * std::numbers::pi)});
  }

  const int count = static_cast<int>(std::ceil(shape.length_mm / kCentrelineStepMm)) + 2;
  samples_.clear();
  samples_.reserve(count);
  for (int i = 0; i < count; ++i) {
    const Eigen::Matrix3d axes = attitude.toRotationMatrix();
    samples_.push_back({position, axes.col(2), axes.col(0), axes.col(1)});
    const double s = (i + 0.5) * kCentrelineStepMm;
    double k1 = gain * shape.twin.Blend(s, [&](double x) { return bend_normal.At(x); });
    double k2 = gain * shape.twin.Blend(s, [&](double x) { return bend_binormal.At(x); });
    const double norm = std::hypot(k1, k2);
    if (norm > max_curvature) {
      k1 *= max_curvature / norm;
      k2 *= max_curvature / norm;
    }
    for (const Bend& bend : bends) {
      const double share = bend.Share(s);
      k1 = (1.0 - share) * k1 + share * bend.sharpest_per_mm * std::cos(bend.direction_rad);
      k2 = (1.0 - share) * k2 + share * bend.sharpest_per_mm * std::sin(bend.direction_rad);
    }
    // The tangent turns towards the normal by k1 and towards the binormal by k2; half a turn before and after the step.
    const Eigen::Quaterniond half_turn = ExpSO3(Eigen::Vector3d(-k2, k1, 0.0) * (0.5 * kCentrelineStepMm));
    const Eigen::Quaterniond middle = attitude * half_turn;
    position += kCentrelineStepMm * (middle * Eigen::Vector3d::UnitZ());
    attitude = (middle * half_turn).normalized();
  }

  const int stride = static_cast<int>(4.0 / kCentrelineStepMm);
  const int near = static_cast<int>(1.6 * shape.clearance_mm / kCentrelineStepMm);
  for (int i = 0; i < count; i += stride) {
    for (int j = i + near; j < count; j += stride) {
      if ((samples_[i].position - samples_[j].position).norm() < shape.clearance_mm) return false;
    }
  }
  return true;
}

CurveFrame Centreline::At(double arc_mm) const {
  const double x = std::clamp(arc_mm, 0.0, length_mm_) / kCentrelineStepMm;
  const int i = std::min(static_cast<int>(x), static_cast<int>(samples_.size()) - 2);
  const double t = x - i;
  const CurveFrame& a = samples_[i];
  const CurveFrame& b = samples_[i + 1];
  CurveFrame out;
  // Cubic Hermite: the direction of a camera that rides on the curve must not jump at the samples.
  const double t2 = t * t, t3 = t2 * t;
  out.position = (2 * t3 - 3 * t2 + 1) * a.position + (3 * t2 - 2 * t3) * b.position +
                 kCentrelineStepMm * ((t3 - 2 * t2 + t) * a.tangent + (t3 - t2) * b.tangent);
  out.tangent = ((1 - t) * a.tangent + t * b.tangent).normalized();
  const Eigen::Vector3d normal = (1 - t) * a.normal + t * b.normal;
  out.normal = (normal - normal.dot(out.tangent) * out.tangent).normalized();
  out.binormal = out.tangent.cross(out.normal);
  return out;
}

}  // namespace haustra::render
