#include "engine/camera/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

namespace haustra {
namespace {

constexpr double kPi = std::numbers::pi;
// The radial curve must rise at least this fast relative to the axis: below, a pixel of noise is a swing of degrees.
constexpr double kMinRelativeSlope = 0.02;
// What is projected may lie this much farther out than the farthest image corner.
constexpr double kRadiusMargin = 1.25;
// A calibration whose model ends within this share of the image's smaller half size is a typing error, not a lens.
constexpr double kMinCoveredShare = 0.7;
constexpr double kPinholeLimitRad = 89.0 * kPi / 180.0;
constexpr int kMaxNewtonSteps = 12;

// r(theta) / theta of Kannala and Brandt, as a polynomial of theta^2, and d r / d theta.
double KannalaBrandtRadius(const std::array<double, 8>& k, double angle, double* derivative) {
  const double a2 = angle * angle;
  const double value = 1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])));
  *derivative = 1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * 9.0 * k[3])));
  return angle * value;
}

// z(rho) of Scaramuzza and d z / d rho.
double OcamDepth(const std::array<double, 8>& a, double rho, double* derivative) {
  *derivative = rho * (2.0 * a[1] + rho * (3.0 * a[2] + rho * 4.0 * a[3]));
  return a[0] + rho * rho * (a[1] + rho * (a[2] + rho * a[3]));
}

// Radial part of the pinhole distortion: distorted radius of the undistorted one and its derivative.
double PinholeRadius(const std::array<double, 8>& k, double radius, double* derivative) {
  const double r2 = radius * radius;
  *derivative = 1.0 + r2 * (3.0 * k[0] + r2 * (5.0 * k[1] + r2 * 7.0 * k[4]));
  return radius * (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])));
}

// Brown's distortion of normalised coordinates with its Jacobian.
Eigen::Vector2d Distort(const std::array<double, 8>& k, const Eigen::Vector2d& m, Eigen::Matrix2d* jacobian) {
  const double p1 = k[2], p2 = k[3];
  const double x = m.x(), y = m.y(), r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double slope = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]));  // d radial / d r2, times 2
  const double cross = slope * x * y + 2.0 * (p1 * x + p2 * y);
  *jacobian << radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x, cross, cross,
      radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
  return {x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
          y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y};
}

Status Bad(const std::string& what, double value) {
  return InvalidArgument("camera calibration: " + what + " (" + std::to_string(value) + ")");
}

Status CheckNumbers(const CameraCalibration& c) {
  if (c.width_px <= 0 || c.height_px <= 0) {
    return InvalidArgument("camera calibration: image size must be positive, is " + std::to_string(c.width_px) + "x" +
                           std::to_string(c.height_px));
  }
  const std::pair<const char*, double> named[] = {{"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}};
  for (const auto& [name, value] : named) {
    if (!std::isfinite(value)) return Bad(std::string(name) + " is not finite", value);
  }
  for (std::size_t i = 0; i < c.coefficients.size(); ++i) {
    if (!std::isfinite(c.coefficients[i])) {
      return Bad("coefficient " + std::to_string(i + 1) + " is not finite", c.coefficients[i]);
    }
  }
  if (c.kind == CameraModelKind::kOcamCalib) {
    if (c.coefficients[0] <= 0) return Bad("a0 must be positive", c.coefficients[0]);
    const double determinant = c.coefficients[4] - c.coefficients[5] * c.coefficients[6];
    if (determinant < 0.1) return Bad("c - d * e must be near 1", determinant);
  } else {
    if (c.fx <= 0) return Bad("fx must be positive", c.fx);
    if (c.fy <= 0) return Bad("fy must be positive", c.fy);
  }
  if (c.cx < -0.5 * c.width_px || c.cx > 1.5 * c.width_px) return Bad("cx is far outside the image", c.cx);
  if (c.cy < -0.5 * c.height_px || c.cy > 1.5 * c.height_px) return Bad("cy is far outside the image", c.cy);
  if (!(c.max_half_angle_deg >= 0 && c.max_half_angle_deg < 180)) {
    return Bad("max_half_angle_deg must be in [0, 180)", c.max_half_angle_deg);
  }
  return Status::Ok();
}

}  // namespace

Result<CameraModel> CameraModel::Create(const CameraCalibration& calibration) {
  HAUSTRA_TRY(CheckNumbers(calibration));
  CameraModel model;
  model.calibration_ = calibration;
  const auto& k = calibration.coefficients;
  if (calibration.kind == CameraModelKind::kOcamCalib) {
    model.pixel_from_distorted_ << k[4], k[5], k[6], 1.0;
    model.focal_px_ = k[0] * std::sqrt(model.pixel_from_distorted_.determinant());
  } else {
    model.pixel_from_distorted_ << calibration.fx, 0.0, 0.0, calibration.fy;
    model.focal_px_ = std::sqrt(calibration.fx * calibration.fy);
  }
  model.distorted_from_pixel_ = model.pixel_from_distorted_.inverse();
  HAUSTRA_TRY(model.FindLimits());
  return model;
}

// Walks outwards along the closed-form direction of the model until it stops rising or the image needs no more, and
// fills the table of the other direction on the way.
Status CameraModel::FindLimits() {
  const auto& k = calibration_.coefficients;
  const bool is_ocam = calibration_.kind == CameraModelKind::kOcamCalib;
  const bool is_pinhole = calibration_.kind == CameraModelKind::kPinhole;

  double needed_radius = 0.0;
  for (const double u : {-0.5, width_px() - 0.5}) {
    for (const double v : {-0.5, height_px() - 0.5}) {
      needed_radius = std::max(needed_radius, DistortedFromPixel({u, v}).norm());
    }
  }
  needed_radius *= kRadiusMargin;

  // `curve(s)` is the forward direction: rho -> angle (OCamCalib), angle -> r (Kannala-Brandt), undistorted ->
  // distorted radius (pinhole).
  const auto curve = [&](double s, double* slope) {
    if (is_pinhole) return PinholeRadius(k, s, slope);
    if (!is_ocam) return KannalaBrandtRadius(k, s, slope);
    double dz;
    const double z = OcamDepth(k, s, &dz);
    *slope = (z - s * dz) / (s * s + z * z);
    return std::atan2(s, z);
  };
  const double end = is_ocam ? needed_radius : is_pinhole ? std::tan(kPinholeLimitRad) : 0.99 * kPi;
  constexpr int kSteps = 8192;
  double axis_slope;
  curve(0.0, &axis_slope);
  double limit = 0.0, limit_value = 0.0;
  for (int i = 1; i <= kSteps; ++i) {
    // The pinhole's undistorted radius is walked in equal steps of angle, or a wide range would be sampled too
    // coarsely.
    const double fraction = static_cast<double>(i) / kSteps;
    const double s = is_pinhole ? std::tan(kPinholeLimitRad * fraction) : end * fraction;
    double slope;
    const double value = curve(s, &slope);
    if (slope < kMinRelativeSlope * axis_slope) break;
    limit = s;
    limit_value = value;
    if (!is_ocam && value >= needed_radius) break;
  }

  const double reached_radius = is_ocam ? limit : limit_value;
  const double reached_px = reached_radius * (is_ocam ? 1.0 : focal_px_);
  const double half_size_px = 0.5 * std::min(width_px(), height_px());
  if (reached_px < kMinCoveredShare * half_size_px) {
    return InvalidArgument("camera calibration: the distortion stops rising " + std::to_string(reached_px) +
                           " px from the principal point, the image needs " + std::to_string(half_size_px) +
                           " (coefficients " + std::to_string(k[0]) + ", " + std::to_string(k[1]) + ", " +
                           std::to_string(k[2]) + ", " + std::to_string(k[3]) + ")");
  }

  max_half_angle_rad_ = is_ocam ? limit_value : is_pinhole ? std::atan(limit) : limit;
  max_radius_ = reached_radius;

  table_intervals_per_unit_ = kTableIntervals / limit_value;
  double low = 0.0;
  for (int i = 1; i < kTableIntervals; ++i) {
    const double value = i / table_intervals_per_unit_;
    double high = limit;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      double slope;
      (curve(middle, &slope) < value ? low : high) = middle;
    }
    inverse_table_[i] = low;
  }
  inverse_table_[kTableIntervals] = limit;

  const double asked_rad = calibration_.max_half_angle_deg * kPi / 180.0;
  if (asked_rad > 0.0 && asked_rad < max_half_angle_rad_) {
    double slope;
    max_radius_ = is_pinhole ? PinholeRadius(k, std::tan(asked_rad), &slope) : RadiusOfAngle(asked_rad, &slope);
    max_half_angle_rad_ = asked_rad;
  }
  max_tangent_ = is_pinhole ? std::tan(max_half_angle_rad_) : 0.0;
  return Status::Ok();
}

ProjectionConstants CameraModel::projection_constants() const {
  ProjectionConstants constants;
  constants.kind = calibration_.kind;
  std::copy(calibration_.coefficients.begin(), calibration_.coefficients.end(), constants.coefficients);
  for (int i = 0; i < 4; ++i) constants.pixel_from_distorted[i] = pixel_from_distorted_(i / 2, i % 2);
  constants.cx = calibration_.cx;
  constants.cy = calibration_.cy;
  constants.max_half_angle_rad = max_half_angle_rad_;
  constants.max_tangent = max_tangent_;
  constants.inverse_table = inverse_table_.data();
  constants.table_intervals_per_unit = table_intervals_per_unit_;
  constants.num_table_intervals = kTableIntervals;
  return constants;
}

double CameraModel::TableGuess(double argument) const {
  const double position = std::max(0.0, argument * table_intervals_per_unit_);
  const int i = std::min(static_cast<int>(position), kTableIntervals - 1);
  return inverse_table_[i] + (position - i) * (inverse_table_[i + 1] - inverse_table_[i]);
}

Eigen::Vector2d CameraModel::DistortedFromPixel(const Eigen::Vector2d& pixel) const {
  return distorted_from_pixel_ * Eigen::Vector2d(pixel.x() - calibration_.cx, pixel.y() - calibration_.cy);
}

Eigen::Vector2d CameraModel::PixelFromDistorted(const Eigen::Vector2d& distorted) const {
  return pixel_from_distorted_ * distorted + Eigen::Vector2d(calibration_.cx, calibration_.cy);
}

double CameraModel::RadiusOfAngle(double angle, double* derivative) const {
  const auto& k = calibration_.coefficients;
  if (calibration_.kind == CameraModelKind::kKannalaBrandt) return KannalaBrandtRadius(k, angle, derivative);
  // OCamCalib: the root of g(rho) = z(rho) sin - rho cos.
  const double s = std::sin(angle), c = std::cos(angle);
  double rho = TableGuess(angle);
  double z = 0.0, dz = 0.0;
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    z = OcamDepth(k, rho, &dz);
    const double step = (z * s - rho * c) / (dz * s - c);
    rho -= step;
    if (std::abs(step) < 1e-10) break;
  }
  z = OcamDepth(k, rho, &dz);
  *derivative = -(z * c + rho * s) / (dz * s - c);
  return rho;
}

double CameraModel::AngleOfRadius(double radius) const {
  const auto& k = calibration_.coefficients;
  if (calibration_.kind == CameraModelKind::kOcamCalib) {
    double dz;
    return std::atan2(radius, OcamDepth(k, radius, &dz));
  }
  double angle = TableGuess(radius);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    double slope;
    const double step = (KannalaBrandtRadius(k, angle, &slope) - radius) / slope;
    angle -= step;
    if (std::abs(step) < 1e-8) break;  // quadratic: the error that is left is far below double precision
  }
  return angle;
}

bool CameraModel::Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel) const {
  const double rho = std::sqrt(point_in_cam.head<2>().squaredNorm());
  const double z = point_in_cam.z();
  if (calibration_.kind == CameraModelKind::kPinhole) {
    if (!(z > 0.0) || !(rho <= z * max_tangent_)) return false;
    Eigen::Matrix2d unused;
    *pixel = PixelFromDistorted(Distort(calibration_.coefficients, point_in_cam.head<2>() / z, &unused));
    return true;
  }
  if (rho < 1e-12 * std::abs(z) || rho == 0.0) {
    if (!(z > 0.0)) return false;
    *pixel = Eigen::Vector2d(calibration_.cx, calibration_.cy);
    return true;
  }
  const double angle = std::atan2(rho, z);
  if (!(angle <= max_half_angle_rad_)) return false;
  double unused;
  *pixel = PixelFromDistorted((RadiusOfAngle(angle, &unused) / rho) * point_in_cam.head<2>());
  return true;
}

bool CameraModel::Project(const Eigen::Vector3d& point_in_cam, Eigen::Vector2d* pixel,
                          ProjectionJacobian* jacobian) const {
  const double x = point_in_cam.x(), y = point_in_cam.y(), z = point_in_cam.z();
  const double rho2 = x * x + y * y;
  const double rho = std::sqrt(rho2);
  ProjectionJacobian distorted;  // d distorted plane / d point
  if (calibration_.kind == CameraModelKind::kPinhole) {
    if (!(z > 0.0) || !(rho <= z * max_tangent_)) return false;
    const double inverse_z = 1.0 / z;
    Eigen::Matrix2d distortion;
    *pixel = PixelFromDistorted(Distort(calibration_.coefficients, point_in_cam.head<2>() * inverse_z, &distortion));
    ProjectionJacobian perspective;
    perspective << inverse_z, 0.0, -x * inverse_z * inverse_z, 0.0, inverse_z, -y * inverse_z * inverse_z;
    distorted = distortion * perspective;
  } else if (rho < 1e-9 * std::abs(z) || rho == 0.0) {
    if (!(z > 0.0)) return false;
    double slope;
    RadiusOfAngle(0.0, &slope);
    const double scale = slope / z;
    *pixel = PixelFromDistorted(scale * point_in_cam.head<2>());
    distorted << scale, 0.0, -scale * x / z, 0.0, scale, -scale * y / z;
  } else {
    const double angle = std::atan2(rho, z);
    if (!(angle <= max_half_angle_rad_)) return false;
    double slope;
    const double scale = RadiusOfAngle(angle, &slope) / rho;
    const double inverse_d2 = 1.0 / (rho2 + z * z);
    // Along the radius the curve's slope counts, across it the ratio radius / rho.
    const double along = slope * z * inverse_d2;
    const double k = (along - scale) / rho2;
    const double depth = -slope * inverse_d2;
    *pixel = PixelFromDistorted(scale * point_in_cam.head<2>());
    distorted << scale + k * x * x, k * x * y, depth * x, k * x * y, scale + k * y * y, depth * y;
  }
  *jacobian = pixel_from_distorted_ * distorted;
  return true;
}

bool CameraModel::Unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* bearing_in_cam) const {
  const Eigen::Vector2d distorted = DistortedFromPixel(pixel);
  const double radius = distorted.norm();
  const auto& k = calibration_.coefficients;
  if (calibration_.kind == CameraModelKind::kPinhole) {
    if (!(radius <= 1.1 * max_radius_)) return false;  // the tangential part is not in max_radius_: checked again below
    Eigen::Vector2d m = radius > 0.0 ? Eigen::Vector2d((TableGuess(radius) / radius) * distorted) : distorted;
    for (int i = 0; i < kMaxNewtonSteps; ++i) {
      Eigen::Matrix2d jacobian;
      const Eigen::Vector2d residual = Distort(k, m, &jacobian) - distorted;
      const double determinant = jacobian.determinant();
      if (!(determinant > 1e-6)) return false;
      const Eigen::Vector2d step = Eigen::Vector2d(jacobian(1, 1) * residual.x() - jacobian(0, 1) * residual.y(),
                                                   jacobian(0, 0) * residual.y() - jacobian(1, 0) * residual.x()) /
                                   determinant;
      m -= step;
      if (step.squaredNorm() < 1e-16) {
        if (!(m.norm() <= max_tangent_)) return false;
        *bearing_in_cam = Eigen::Vector3d(m.x(), m.y(), 1.0).normalized();
        return true;
      }
    }
    return false;
  }
  if (!(radius <= max_radius_)) return false;
  if (calibration_.kind == CameraModelKind::kOcamCalib) {
    double unused;
    *bearing_in_cam = Eigen::Vector3d(distorted.x(), distorted.y(), OcamDepth(k, radius, &unused)).normalized();
    return true;
  }
  if (radius < 1e-12) {
    *bearing_in_cam = Eigen::Vector3d(distorted.x(), distorted.y(), 1.0);
    return true;
  }
  const double angle = AngleOfRadius(radius);
  const double scale = std::sin(angle) / radius;
  *bearing_in_cam = Eigen::Vector3d(scale * distorted.x(), scale * distorted.y(), std::cos(angle));
  return true;
}

}  // namespace haustra
