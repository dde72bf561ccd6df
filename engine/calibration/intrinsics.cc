#include "engine/calibration/intrinsics.h"

#include <algorithm>
#include <cmath>

namespace haustra::calibration {
namespace {

constexpr double kLargestAngle = 2.0;  // rad; no endoscope sees further

double RadiusOf(const Intrinsics& c, double angle) {
  const double a2 = angle * angle;
  return angle * (1.0 + a2 * (c.k1 + a2 * c.k2));
}

double SlopeOf(const Intrinsics& c, double angle) {
  const double a2 = angle * angle;
  return 1.0 + a2 * (3.0 * c.k1 + a2 * 5.0 * c.k2);
}

}  // namespace

IntrinsicVector Intrinsics::Vector() const {
  IntrinsicVector v;
  v << std::log(focal_px), cx, cy, k1, k2;
  return v;
}

Intrinsics Intrinsics::Plus(const IntrinsicVector& step) const {
  Intrinsics out;
  out.focal_px = focal_px * std::exp(std::clamp(step[kLogFocal], -1.0, 1.0));
  out.cx = cx + step[kCx];
  out.cy = cy + step[kCy];
  out.k1 = k1 + step[kK1];
  out.k2 = k2 + step[kK2];
  return out;
}

double Intrinsics::MaxAngle() const {
  // Smallest positive root of 1 + 3 k1 q + 5 k2 q^2, q the square of the angle.
  const double a = 5.0 * k2, b = 3.0 * k1;
  double root = kLargestAngle * kLargestAngle;
  if (std::abs(a) < 1e-12) {
    if (b < 0.0) root = std::min(root, -1.0 / b);
  } else {
    const double discriminant = b * b - 4.0 * a;
    if (discriminant > 0.0) {
      const double s = std::sqrt(discriminant);
      for (const double q : {(-b - s) / (2.0 * a), (-b + s) / (2.0 * a)}) {
        if (q > 0.0) root = std::min(root, q);
      }
    }
  }
  return std::sqrt(root);
}

bool Intrinsics::Project(const Eigen::Vector3d& p, Eigen::Vector2d* pixel, Eigen::Matrix<double, 2, 3>* by_point,
                         Eigen::Matrix<double, 2, kNumIntrinsics>* by_intrinsics) const {
  const double rho2 = p.x() * p.x() + p.y() * p.y();
  const double n2 = rho2 + p.z() * p.z();
  if (!(n2 > 1e-24)) return false;
  const double rho = std::sqrt(rho2);
  const double angle = std::atan2(rho, p.z());
  const double a2 = angle * angle;
  const double slope = SlopeOf(*this, angle);
  if (angle > kLargestAngle || slope <= 0.0) return false;
  const bool is_axial = rho < 1e-9 * std::abs(p.z());
  const double inverse_rho = is_axial ? 0.0 : 1.0 / rho;
  // Radius in the distorted plane over radius in space.
  const double scale = is_axial ? 1.0 / p.z() : RadiusOf(*this, angle) * inverse_rho;
  *pixel = Eigen::Vector2d(cx + focal_px * scale * p.x(), cy + focal_px * scale * p.y());
  if (by_point != nullptr) {
    const double by_rho = is_axial ? 0.0 : (slope * p.z() / n2 - scale) * inverse_rho * inverse_rho;
    const double by_z = -slope / n2;
    *by_point << scale + p.x() * p.x() * by_rho, p.x() * p.y() * by_rho, p.x() * by_z,  //
        p.x() * p.y() * by_rho, scale + p.y() * p.y() * by_rho, p.y() * by_z;
    *by_point *= focal_px;
  }
  if (by_intrinsics != nullptr) {
    const double cubic = focal_px * angle * a2 * inverse_rho;
    *by_intrinsics << pixel->x() - cx, 1.0, 0.0, cubic * p.x(), cubic * a2 * p.x(),  //
        pixel->y() - cy, 0.0, 1.0, cubic * p.y(), cubic * a2 * p.y();
  }
  return true;
}

bool Intrinsics::Unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* bearing_in_cam) const {
  const Eigen::Vector2d offset((pixel.x() - cx) / focal_px, (pixel.y() - cy) / focal_px);
  const double radius = offset.norm();
  if (radius < 1e-12) {
    *bearing_in_cam = Eigen::Vector3d::UnitZ();
    return true;
  }
  // The radius grows with the angle up to MaxAngle: bisection brackets what Newton might leave.
  double low = 0.0, high = MaxAngle();
  if (RadiusOf(*this, high) < radius) return false;
  double angle = std::min(radius, 0.5 * high);
  for (int i = 0; i < 60; ++i) {
    const double error = RadiusOf(*this, angle) - radius;
    if (std::abs(error) < 1e-13) break;
    (error > 0.0 ? high : low) = angle;
    const double next = angle - error / SlopeOf(*this, angle);
    angle = next > low && next < high ? next : 0.5 * (low + high);
  }
  const double s = std::sin(angle) / radius;
  *bearing_in_cam = Eigen::Vector3d(s * offset.x(), s * offset.y(), std::cos(angle));
  return true;
}

CameraCalibration Intrinsics::ToCalibration(int width_px, int height_px, double rate_hz) const {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kKannalaBrandt;
  calibration.width_px = width_px;
  calibration.height_px = height_px;
  calibration.fx = focal_px;
  calibration.fy = focal_px;
  calibration.cx = cx;
  calibration.cy = cy;
  calibration.coefficients = {k1, k2};
  calibration.rate_hz = rate_hz;
  return calibration;
}

}  // namespace haustra::calibration
