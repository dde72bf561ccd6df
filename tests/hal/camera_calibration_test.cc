#include "hal/camera_calibration.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace haustra {
namespace {

using Ray = std::array<double, 3>;
using Pixel = std::array<double, 2>;

// Where the same point of the scene lies in the picture averaged over 2x2 pixels.
Pixel InHalf(const Pixel& p) { return {(p[0] + 0.5) / 2 - 0.5, (p[1] + 0.5) / 2 - 0.5}; }

Pixel ProjectKannalaBrandt(const CameraCalibration& c, const Ray& p) {
  const double rho = std::hypot(p[0], p[1]), th = std::atan2(rho, p[2]);
  double r = th;
  for (int i = 0; i < 4; ++i) r += c.coefficients[i] * std::pow(th, 3 + 2 * i);
  return {c.fx * r * p[0] / rho + c.cx, c.fy * r * p[1] / rho + c.cy};
}

Pixel ProjectPinhole(const CameraCalibration& c, const Ray& p) {
  const double x = p[0] / p[2], y = p[1] / p[2], r2 = x * x + y * y;
  const auto& k = c.coefficients;
  const double radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
  return {c.fx * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + c.cx,
          c.fy * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + c.cy};
}

Ray UnprojectOcam(const CameraCalibration& c, const Pixel& p) {
  const auto& k = c.coefficients;
  const double du = p[0] - c.cx, dv = p[1] - c.cy, determinant = k[4] - k[5] * k[6];
  const double x = (du - k[5] * dv) / determinant, y = (k[4] * dv - k[6] * du) / determinant;
  const double rho = std::hypot(x, y);
  const Ray ray{x, y, k[0] + k[1] * rho * rho + k[2] * std::pow(rho, 3) + k[3] * std::pow(rho, 4)};
  const double length = std::sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]);
  return {ray[0] / length, ray[1] / length, ray[2] / length};
}

CameraCalibration Example(CameraModelKind kind) {
  CameraCalibration c;
  c.kind = kind;
  c.width_px = 1440;
  c.height_px = 1080;
  c.fx = 717.2;
  c.fy = 716.9;
  c.cx = 735.4;
  c.cy = 552.8;
  c.rate_hz = 50;
  c.max_half_angle_deg = 85;
  switch (kind) {
    case CameraModelKind::kKannalaBrandt: c.coefficients = {-0.139, -0.0012, 0.0015, -0.00023}; break;
    case CameraModelKind::kPinhole: c.coefficients = {0.08, -0.02, 0.001, -0.002, 0.003}; break;
    case CameraModelKind::kOcamCalib: c.coefficients = {769.2, -5.4e-4, 1.1e-7, -2.5e-10, 0.9995, 1.2e-3, -8e-4}; break;
  }
  return c;
}

const Ray kRays[] = {{0.1, 0.05, 1.0}, {-0.7, 0.4, 1.0}, {0.9, -0.8, 0.7}, {0.3, 0.9, 1.2}};

TEST(HalvedCalibration, KannalaBrandtProjectsWhereAveragingPutsThePoint) {
  const CameraCalibration full = Example(CameraModelKind::kKannalaBrandt), half = Halved(full);
  for (const Ray& ray : kRays) {
    const Pixel expected = InHalf(ProjectKannalaBrandt(full, ray)), actual = ProjectKannalaBrandt(half, ray);
    EXPECT_NEAR(actual[0], expected[0], 1e-9);
    EXPECT_NEAR(actual[1], expected[1], 1e-9);
  }
}

TEST(HalvedCalibration, PinholeProjectsWhereAveragingPutsThePoint) {
  const CameraCalibration full = Example(CameraModelKind::kPinhole), half = Halved(full);
  for (const Ray& ray : kRays) {
    const Pixel expected = InHalf(ProjectPinhole(full, ray)), actual = ProjectPinhole(half, ray);
    EXPECT_NEAR(actual[0], expected[0], 1e-9);
    EXPECT_NEAR(actual[1], expected[1], 1e-9);
  }
}

TEST(HalvedCalibration, OcamCalibKeepsTheRayOfEveryPoint) {
  const CameraCalibration full = Example(CameraModelKind::kOcamCalib), half = Halved(full);
  for (const Pixel& pixel : {Pixel{735, 552}, Pixel{0, 0}, Pixel{1439, 300}, Pixel{200, 1079}}) {
    const Ray expected = UnprojectOcam(full, pixel), actual = UnprojectOcam(half, InHalf(pixel));
    for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(actual[axis], expected[axis], 1e-12);
  }
}

TEST(HalvedCalibration, SizeIsHalvedAndRateAndAngleStay) {
  CameraCalibration full = Example(CameraModelKind::kKannalaBrandt);
  full.width_px = 1351;
  const CameraCalibration half = Halved(full);
  EXPECT_EQ(half.width_px, 675);
  EXPECT_EQ(half.height_px, 540);
  EXPECT_EQ(half.rate_hz, full.rate_hz);
  EXPECT_EQ(half.max_half_angle_deg, full.max_half_angle_deg);
  EXPECT_EQ(half.kind, full.kind);
}

}  // namespace
}  // namespace haustra
