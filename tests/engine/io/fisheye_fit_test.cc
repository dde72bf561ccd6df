#include "engine/io/fisheye_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

namespace haustra {
namespace {

// Kannala-Brandt written out, independent of engine/camera.
Eigen::Vector2d ProjectKannalaBrandt(const CameraCalibration& c, const Eigen::Vector3d& p) {
  const double rho = std::hypot(p.x(), p.y());
  const double th = std::atan2(rho, p.z());
  const double r = th + c.coefficients[0] * std::pow(th, 3) + c.coefficients[1] * std::pow(th, 5) +
                   c.coefficients[2] * std::pow(th, 7) + c.coefficients[3] * std::pow(th, 9);
  if (rho == 0.0) return {c.cx, c.cy};
  return {c.fx * r * p.x() / rho + c.cx, c.fy * r * p.y() / rho + c.cy};
}

CameraCalibration Ocam(double c, double d, double e) {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kOcamCalib;
  calibration.width_px = 675;
  calibration.height_px = 540;
  calibration.cx = 339.25;
  calibration.cy = 271.5;
  calibration.coefficients = {384.0, -1.1e-3, 6.0e-7, -1.0e-9, c, d, e};
  return calibration;
}

// Ray of a pixel by the definition of the model (Scaramuzza 2006).
Eigen::Vector3d OcamRay(const CameraCalibration& calibration, const Eigen::Vector2d& pixel) {
  const auto& k = calibration.coefficients;
  Eigen::Matrix2d affine;
  affine << k[4], k[5], k[6], 1.0;
  const Eigen::Vector2d xy = affine.inverse() * (pixel - Eigen::Vector2d(calibration.cx, calibration.cy));
  const double rho = xy.norm();
  return {xy.x(), xy.y(), k[0] + k[1] * rho * rho + k[2] * std::pow(rho, 3) + k[3] * std::pow(rho, 4)};
}

double RmsOverImage(const CameraCalibration& ocam, const CameraCalibration& fitted) {
  double sum = 0.0;
  int count = 0;
  for (double v = 0; v < ocam.height_px; v += 13.0) {
    for (double u = 0; u < ocam.width_px; u += 13.0) {
      sum += (ProjectKannalaBrandt(fitted, OcamRay(ocam, {u, v})) - Eigen::Vector2d(u, v)).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

TEST(FitFisheye, KannalaBrandtCameraIsFoundAgain) {
  CameraCalibration truth;
  truth.kind = CameraModelKind::kKannalaBrandt;
  truth.width_px = 720;
  truth.height_px = 540;
  truth.fx = 398.2;
  truth.fy = 397.6;
  truth.cx = 362.4;
  truth.cy = 268.1;
  truth.coefficients = {-0.045, 0.008, -0.0031, 0.0005};
  const Result<CameraModel> camera = CameraModel::Create(truth);
  ASSERT_TRUE(camera.ok());
  const Result<FisheyeFit> fit = FitFisheye(*camera);
  ASSERT_TRUE(fit.ok()) << fit.status().ToString();
  EXPECT_LT(fit->max_px, 1e-4);
  EXPECT_NEAR(fit->calibration.fx, truth.fx, 1e-2);
  EXPECT_NEAR(fit->calibration.cy, truth.cy, 1e-3);
}

TEST(FitFisheye, OcamCalibWithoutShearIsMatchedToAFractionOfAPixel) {
  const CameraCalibration ocam = Ocam(1.002, 0.0, 0.0);
  const Result<CameraModel> camera = CameraModel::Create(ocam);
  ASSERT_TRUE(camera.ok()) << camera.status().ToString();
  const Result<FisheyeFit> fit = FitFisheye(*camera);
  ASSERT_TRUE(fit.ok()) << fit.status().ToString();
  const double rms = RmsOverImage(ocam, fit->calibration);
  EXPECT_LT(rms, 0.1);
  EXPECT_NEAR(fit->rms_px, rms, 0.02);
  EXPECT_GE(fit->max_px, fit->rms_px);
}

TEST(FitFisheye, ShearOfOcamCalibIsReportedAsResidual) {
  const CameraCalibration ocam = Ocam(1.0, 0.01, 0.0);
  const Result<CameraModel> camera = CameraModel::Create(ocam);
  ASSERT_TRUE(camera.ok()) << camera.status().ToString();
  const Result<FisheyeFit> fit = FitFisheye(*camera);
  ASSERT_TRUE(fit.ok()) << fit.status().ToString();
  // A shear of 1 % moves the rows at the edge by 2.7 px; hardly any of it can be taken up by the other parameters.
  EXPECT_GT(fit->rms_px, 0.8);
  EXPECT_NEAR(fit->rms_px, RmsOverImage(ocam, fit->calibration), 0.1);
}

}  // namespace
}  // namespace haustra
