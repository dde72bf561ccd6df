#include "engine/camera/camera_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "engine/geometry/constants.h"
#include "engine/geometry/rng.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

// C3VD v1 as published (config/cameras): the axes of the polynomial's affine part are those of the header.
CameraCalibration C3vdOcam() {
  CameraCalibration c;
  c.kind = CameraModelKind::kOcamCalib;
  c.width_px = 1350;
  c.height_px = 1080;
  c.cx = 678.544839;
  c.cy = 542.975888;
  c.coefficients = {769.243600037458, -8.12770624150226e-4, 6.25674244578925e-7, -1.19662182144280e-9,
                    0.99998688224999, 0.00288273829525059,  -0.00296316513429569};
  return c;
}

CameraCalibration C3vdKannalaBrandt() {
  CameraCalibration c = C3vdOcam();
  c.kind = CameraModelKind::kKannalaBrandt;
  c.fx = c.fy = 769.5824;
  c.coefficients = {-0.20549581, 0.02588519, 0.00672134, -0.00174734};
  return c;
}

CameraCalibration EndoMapper() {
  CameraCalibration c;
  c.kind = CameraModelKind::kKannalaBrandt;
  c.width_px = 1440;
  c.height_px = 1080;
  c.fx = 717.2104;
  c.fy = 717.4816;
  c.cx = 735.3566;
  c.cy = 552.7982;
  c.coefficients = {-0.1389272, -0.001239606, 0.0009125824, -4.071615e-05};
  return c;
}

// 170 degrees across the shorter side.
CameraCalibration WideFisheye() {
  CameraCalibration c = test::ColonCalibration();
  c.fx = c.fy = 180.0;
  c.coefficients = {-0.01, 0.002, -0.0005, 0.0};
  return c;
}

CameraCalibration Pinhole() {
  CameraCalibration c;
  c.kind = CameraModelKind::kPinhole;
  c.width_px = 540;
  c.height_px = 540;
  c.fx = 333.107;
  c.fy = 335.0;
  c.cx = 269.5105;
  c.cy = 270.8205;
  return c;
}

CameraCalibration DistortedPinhole() {
  CameraCalibration c = Pinhole();
  c.coefficients = {-0.21, 0.06, 0.0012, -0.0017, -0.005};
  return c;
}

struct NamedCalibration {
  std::string name;
  CameraCalibration calibration;
};

class EveryCamera : public ::testing::TestWithParam<NamedCalibration> {
 protected:
  CameraModel camera_ = CameraModel::Create(GetParam().calibration).value();
};

INSTANTIATE_TEST_SUITE_P(Models, EveryCamera,
                         ::testing::Values(NamedCalibration{"Colon", test::ColonCalibration()},
                                           NamedCalibration{"C3vdOcam", C3vdOcam()},
                                           NamedCalibration{"C3vdKannalaBrandt", C3vdKannalaBrandt()},
                                           NamedCalibration{"EndoMapper", EndoMapper()},
                                           NamedCalibration{"EndoMapperHalved", Halved(EndoMapper())},
                                           NamedCalibration{"C3vdOcamHalved", Halved(C3vdOcam())},
                                           NamedCalibration{"WideFisheye", WideFisheye()},
                                           NamedCalibration{"Pinhole", Pinhole()},
                                           NamedCalibration{"DistortedPinhole", DistortedPinhole()}),
                         [](const auto& instance) { return instance.param.name; });

TEST_P(EveryCamera, PixelsOfTheWholeImageComeBack) {
  int num_seen = 0;
  for (double v = 0.0; v <= camera_.height_px() - 1; v += 9.7) {
    for (double u = 0.0; u <= camera_.width_px() - 1; u += 9.3) {
      Eigen::Vector3d bearing;
      if (!camera_.Unproject({u, v}, &bearing)) continue;
      ++num_seen;
      EXPECT_NEAR(bearing.norm(), 1.0, 1e-12);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera_.Project(3.7 * bearing, &pixel)) << u << ", " << v;
      EXPECT_NEAR(pixel.x(), u, 1e-7);
      EXPECT_NEAR(pixel.y(), v, 1e-7);
    }
  }
  EXPECT_GT(num_seen, 1000);
}

TEST_P(EveryCamera, BearingsUpToTheLastAngleComeBack) {
  for (double share = 0.0; share < 0.9999; share += 0.0271) {
    for (double around = 0.1; around < 6.28; around += 0.37) {
      const double angle = share * camera_.max_half_angle_rad();
      const Eigen::Vector3d truth(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                                  std::cos(angle));
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera_.Project(truth, &pixel)) << angle / kDegree;
      Eigen::Vector3d bearing;
      if (!camera_.Unproject(pixel, &bearing)) {
        // The tangential part of the pinhole may push the last few degrees, far outside the image, over the edge.
        EXPECT_EQ(camera_.calibration().kind, CameraModelKind::kPinhole);
        EXPECT_FALSE(camera_.IsInImage(pixel));
        continue;
      }
      EXPECT_LT((bearing - truth).norm(), 1e-9) << angle / kDegree;
    }
  }
}

TEST_P(EveryCamera, JacobianMatchesNumericDifferentiation) {
  Rng rng(7);
  for (int trial = 0; trial < 2000; ++trial) {
    const double angle = rng.Uniform(0.0, 0.999) * camera_.max_half_angle_rad();
    const double around = rng.Uniform(0.0, 2.0 * std::numbers::pi), distance = rng.Uniform(0.5, 20.0);
    const Eigen::Vector3d point = distance * Eigen::Vector3d(std::sin(angle) * std::cos(around),
                                                             std::sin(angle) * std::sin(around), std::cos(angle));
    Eigen::Vector2d pixel, same_pixel;
    CameraModel::ProjectionJacobian jacobian, numeric;
    ASSERT_TRUE(camera_.Project(point, &pixel, &jacobian));
    ASSERT_TRUE(camera_.Project(point, &same_pixel));
    EXPECT_LT((pixel - same_pixel).norm(), 1e-9);
    const double h = 1e-5 * distance;
    bool is_inside = true;
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector2d after, before;
      is_inside = is_inside && camera_.Project(point + h * Eigen::Vector3d::Unit(axis), &after) &&
                  camera_.Project(point - h * Eigen::Vector3d::Unit(axis), &before);
      numeric.col(axis) = (after - before) / (2.0 * h);
    }
    if (!is_inside) continue;  // within a hundred thousandth of the edge
    EXPECT_LT((jacobian - numeric).norm(), 1e-5 * (1.0 + jacobian.norm())) << angle / kDegree;
  }
}

TEST_P(EveryCamera, JacobianOnTheAxisMatchesNumericDifferentiation) {
  const Eigen::Vector3d point(0.0, 0.0, 2.5);
  Eigen::Vector2d pixel;
  CameraModel::ProjectionJacobian jacobian;
  ASSERT_TRUE(camera_.Project(point, &pixel, &jacobian));
  EXPECT_NEAR(pixel.x(), camera_.calibration().cx, 1e-9);
  EXPECT_NEAR(pixel.y(), camera_.calibration().cy, 1e-9);
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::Vector2d after, before;
    ASSERT_TRUE(camera_.Project(point + 1e-5 * Eigen::Vector3d::Unit(axis), &after));
    ASSERT_TRUE(camera_.Project(point - 1e-5 * Eigen::Vector3d::Unit(axis), &before));
    EXPECT_LT((jacobian.col(axis) - (after - before) / 2e-5).norm(), 1e-4);
  }
}

TEST_P(EveryCamera, PointsBehindOrAtTheCentreHaveNoPixel) {
  Eigen::Vector2d pixel;
  CameraModel::ProjectionJacobian jacobian;
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(0, 0, 0),
                                       Eigen::Vector3d(0.01, 0.01, -1), Eigen::Vector3d(1e-13, 0, -1)}) {
    EXPECT_FALSE(camera_.Project(point, &pixel));
    EXPECT_FALSE(camera_.Project(point, &pixel, &jacobian));
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(camera_.Project(Eigen::Vector3d(nan, 0, 1), &pixel));
  Eigen::Vector3d bearing;
  EXPECT_FALSE(camera_.Unproject({nan, 3.0}, &bearing));
  EXPECT_FALSE(camera_.Unproject({1e6, -1e6}, &bearing));
}

TEST(CameraModel, KannalaBrandtReachesSeventyPlusDegreesOfHalfAngleOnEndoMapper) {
  const CameraModel camera = CameraModel::Create(EndoMapper()).value();
  // The published figures, whole degrees: 46 to 48 at r = 540 px, 70 to 76 at r = 720 px.
  for (const auto& [radius, low, high] : {std::tuple{540.0, 45.5, 48.5}, std::tuple{720.0, 69.5, 76.5}}) {
    Eigen::Vector3d bearing;
    ASSERT_TRUE(camera.Unproject({camera.calibration().cx - radius, camera.calibration().cy}, &bearing));
    const double angle_deg = std::acos(bearing.z()) / kDegree;
    EXPECT_GT(angle_deg, low);
    EXPECT_LT(angle_deg, high);
  }
}

TEST(CameraModel, KannalaBrandtPixelIsThePublishedFormula) {
  const CameraCalibration c = test::ColonCalibration();
  const CameraModel camera = CameraModel::Create(c).value();
  const double angle = 40.0 * kDegree, a2 = angle * angle;
  const double r = angle * (1 - 0.045 * a2 + 0.008 * a2 * a2 - 0.0031 * a2 * a2 * a2 + 0.0005 * a2 * a2 * a2 * a2);
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.Project({0.6 * std::sin(angle), 0.8 * std::sin(angle), std::cos(angle)}, &pixel));
  EXPECT_NEAR(pixel.x(), 398.2 * 0.6 * r + 362.4, 1e-9);
  EXPECT_NEAR(pixel.y(), 397.6 * 0.8 * r + 268.1, 1e-9);
}

TEST(CameraModel, WideFisheyeHoldsToOneHundredSeventyDegrees) {
  const CameraModel camera = CameraModel::Create(WideFisheye()).value();
  EXPECT_GE(camera.max_half_angle_rad(), 85.0 * kDegree);
  const Eigen::Vector3d truth(std::sin(85.0 * kDegree), 0.0, std::cos(85.0 * kDegree));
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.Project(truth, &pixel));
  Eigen::Vector3d bearing;
  ASSERT_TRUE(camera.Unproject(pixel, &bearing));
  EXPECT_LT((bearing - truth).norm(), 1e-12);
}

TEST(CameraModel, OcamDepthPolynomialIsThePublishedFormula) {
  const CameraCalibration c = C3vdOcam();
  const CameraModel camera = CameraModel::Create(c).value();
  // Golden points by hand from the published polynomial: the pixel of (x, y), and the ray (x, y, z(rho)).
  const Eigen::Vector2d xy(300.0, 400.0);  // rho = 500
  const double z =
      769.243600037458 - 8.12770624150226e-4 * 25e4 + 6.25674244578925e-7 * 125e6 - 1.19662182144280e-9 * 625e8;
  const Eigen::Vector2d pixel(0.99998688224999 * 300.0 + 0.00288273829525059 * 400.0 + 678.544839,
                              -0.00296316513429569 * 300.0 + 400.0 + 542.975888);
  const Eigen::Vector3d truth = Eigen::Vector3d(xy.x(), xy.y(), z).normalized();
  Eigen::Vector3d bearing;
  ASSERT_TRUE(camera.Unproject(pixel, &bearing));
  EXPECT_LT((bearing - truth).norm(), 1e-12);
  Eigen::Vector2d projected;
  ASSERT_TRUE(camera.Project(17.0 * truth, &projected));
  EXPECT_LT((projected - pixel).norm(), 1e-8);
}

TEST(CameraModel, C3vdOcamAgreesWithItsKannalaBrandtFit) {
  CameraCalibration ocam_without_affine = C3vdOcam();
  ocam_without_affine.coefficients[4] = 1.0;
  ocam_without_affine.coefficients[5] = ocam_without_affine.coefficients[6] = 0.0;
  const CameraModel ocam = CameraModel::Create(ocam_without_affine).value();
  const CameraModel fit = CameraModel::Create(C3vdKannalaBrandt()).value();
  double worst_px = 0.0;
  int compared = 0;
  for (double radius = 0.0; radius <= 870.0; radius += 5.0) {
    for (double around = 0.0; around < 6.28; around += 0.3) {
      const Eigen::Vector2d pixel(ocam.calibration().cx + radius * std::cos(around),
                                  ocam.calibration().cy + radius * std::sin(around));
      Eigen::Vector3d bearing;
      Eigen::Vector2d by_fit;
      ASSERT_TRUE(ocam.Unproject(pixel, &bearing));
      ASSERT_TRUE(fit.Project(bearing, &by_fit)) << radius;
      worst_px = std::max(worst_px, (by_fit - pixel).norm());
      ++compared;
    }
  }
  EXPECT_GT(compared, 3000);
  EXPECT_LT(worst_px, 1.2);  // the residual that config/cameras/c3vd_v1_kannala_brandt.yaml states
  EXPECT_GT(worst_px, 0.1);  // two different formulas: a perfect match would mean that one test object is the other
}

TEST(CameraModel, HalvedCameraSeesTheSameDirections) {
  for (const CameraCalibration& full_calibration : {C3vdOcam(), EndoMapper(), DistortedPinhole()}) {
    const CameraModel full = CameraModel::Create(full_calibration).value();
    const CameraModel half = CameraModel::Create(Halved(full_calibration)).value();
    Eigen::Vector3d from_full, from_half;
    ASSERT_TRUE(full.Unproject({101.0, 203.0}, &from_full));
    ASSERT_TRUE(half.Unproject({(101.0 + 0.5) / 2 - 0.5, (203.0 + 0.5) / 2 - 0.5}, &from_half));
    EXPECT_LT((from_full - from_half).norm(), 1e-10);
  }
}

TEST(CameraModel, PinholeDistortionIsBrownsFormula) {
  const CameraModel camera = CameraModel::Create(DistortedPinhole()).value();
  const double x = 0.3, y = -0.2, r2 = 0.13;
  const double radial = 1 - 0.21 * r2 + 0.06 * r2 * r2 - 0.005 * r2 * r2 * r2;
  const double p1 = 0.0012, p2 = -0.0017;
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.Project({2 * x, 2 * y, 2.0}, &pixel));
  EXPECT_NEAR(pixel.x(), 333.107 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + 269.5105, 1e-9);
  EXPECT_NEAR(pixel.y(), 335.0 * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + 270.8205, 1e-9);
}

TEST(CameraModel, AskedFieldOfViewLimitsProjectionAndUnprojection) {
  CameraCalibration c = test::ColonCalibration();
  c.max_half_angle_deg = 30.0;
  const CameraModel camera = CameraModel::Create(c).value();
  EXPECT_NEAR(camera.max_half_angle_rad(), 30.0 * kDegree, 1e-12);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.Project({std::sin(29.9 * kDegree), 0, std::cos(29.9 * kDegree)}, &pixel));
  EXPECT_FALSE(camera.Project({std::sin(30.1 * kDegree), 0, std::cos(30.1 * kDegree)}, &pixel));
  Eigen::Vector3d bearing;
  EXPECT_FALSE(camera.Unproject({1.0, 1.0}, &bearing));
}

TEST(CameraModel, BadCalibrationIsRefusedWithTheNameOfTheParameter) {
  const auto message = [](auto change) {
    CameraCalibration c = test::ColonCalibration();
    change(c);
    const Result<CameraModel> result = CameraModel::Create(c);
    EXPECT_FALSE(result.ok());
    EXPECT_EQ(result.code(), StatusCode::kInvalidArgument);
    return result.status().message();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message([&](auto& c) { c.fx = nan; }).find("fx"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.fy = -397.6; }).find("fy"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.cx = 3624.0; }).find("3624"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.cy = -900.0; }).find("cy"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.width_px = 0; }).find("0x540"), std::string::npos);
  EXPECT_NE(message([&](auto& c) { c.coefficients[2] = nan; }).find("coefficient 3"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.max_half_angle_deg = 400; }).find("max_half_angle_deg"), std::string::npos);
  EXPECT_NE(message([](auto& c) { c.coefficients[0] = -4.5; }).find("stops rising"), std::string::npos);
  EXPECT_NE(message([](auto& c) {
              c = C3vdOcam();
              c.coefficients[0] = -769.0;
            }).find("a0"),
            std::string::npos);
}

}  // namespace
}  // namespace haustra
