#include "tools/render/calibration_error.h"

#include <gtest/gtest.h>

#include "engine/camera/camera_model.h"
#include "tools/render/preset.h"

namespace haustra::render {
namespace {

TEST(CalibrationError, PartsThatAreLeftOutAreZero) {
  const auto one = ParseCalibrationError("2");
  ASSERT_TRUE(one.ok());
  EXPECT_EQ(one->focal_percent, 2.0);
  EXPECT_EQ(one->cx_px, 0.0);
  EXPECT_EQ(one->k1, 0.0);
  const auto all = ParseCalibrationError("-1.5,3,-2,0.01");
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->focal_percent, -1.5);
  EXPECT_EQ(all->cx_px, 3.0);
  EXPECT_EQ(all->cy_px, -2.0);
  EXPECT_EQ(all->k1, 0.01);
  EXPECT_TRUE(ParseCalibrationError("0,0,0,0")->is_none());
  EXPECT_FALSE(all->is_none());
}

TEST(CalibrationError, MistakeIsNamed) {
  for (const char* text : {"", "x", "1,", "1,2,3,4,5", "1,,2", "nan", "2%"}) {
    const auto error = ParseCalibrationError(text);
    ASSERT_FALSE(error.ok()) << text;
    EXPECT_EQ(error.code(), StatusCode::kInvalidArgument);
  }
}

TEST(CalibrationError, OutOfRangeIsNamed) {
  EXPECT_TRUE((CalibrationError{20.0, 72.0, -72.0, 0.1}).Validate(720).ok());
  EXPECT_NE((CalibrationError{-21.0, 0.0, 0.0, 0.0}).Validate(720).message().find("focal"), std::string::npos);
  EXPECT_NE((CalibrationError{0.0, 73.0, 0.0, 0.0}).Validate(720).message().find("cx"), std::string::npos);
  EXPECT_NE((CalibrationError{0.0, 0.0, -73.0, 0.0}).Validate(720).message().find("cy"), std::string::npos);
  EXPECT_NE((CalibrationError{0.0, 0.0, 0.0, 0.11}).Validate(720).message().find("k1"), std::string::npos);
}

// A point projected by both cameras: the offset from the centre grows by the focal error, the centre moves along.
TEST(CalibrationError, PictureScalesAboutAMovedCentre) {
  const CameraCalibration truth = CalibrationFor(360, 270, 25.0);
  const CameraCalibration written = Misjudged(truth, {2.0, 3.0, -1.0, 0.0});
  const auto true_camera = CameraModel::Create(truth), written_camera = CameraModel::Create(written);
  ASSERT_TRUE(true_camera.ok() && written_camera.ok());
  const Eigen::Vector3d point(7.0, -4.0, 12.0);
  Eigen::Vector2d seen, expected;
  ASSERT_TRUE(true_camera->Project(point, &seen) && written_camera->Project(point, &expected));
  EXPECT_NEAR(expected.x() - written.cx, 1.02 * (seen.x() - truth.cx), 1e-9);
  EXPECT_NEAR(expected.y() - written.cy, 1.02 * (seen.y() - truth.cy), 1e-9);
  EXPECT_NEAR(written.cx, truth.cx + 3.0, 1e-12);
  EXPECT_NEAR(written.cy, truth.cy - 1.0, 1e-12);
}

// r = theta + k1 theta^3 + ...: at an angle theta the picture moves by f k1 theta^3.
TEST(CalibrationError, FirstCoefficientMovesTheRim) {
  const CameraCalibration truth = CalibrationFor(360, 270, 25.0);
  const auto true_camera = CameraModel::Create(truth),
             written_camera = CameraModel::Create(Misjudged(truth, {0.0, 0.0, 0.0, 0.02}));
  ASSERT_TRUE(true_camera.ok() && written_camera.ok());
  const double theta = 0.7;
  const Eigen::Vector3d point(std::sin(theta), 0.0, std::cos(theta));
  Eigen::Vector2d seen, expected;
  ASSERT_TRUE(true_camera->Project(point, &seen) && written_camera->Project(point, &expected));
  EXPECT_NEAR(expected.x() - seen.x(), truth.fx * 0.02 * theta * theta * theta, 1e-9);
}

}  // namespace
}  // namespace haustra::render
