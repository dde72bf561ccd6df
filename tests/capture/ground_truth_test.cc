#include "capture/ground_truth.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/dataset/rotation.h"
#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kHalf = 0.70710678118654752;  // sin and cos of 45 degrees

class GroundTruthTest : public ::testing::Test {
 protected:
  Result<std::vector<GroundTruthPose>> ReadText(std::string_view text) {
    return ReadGroundTruth(folder_.Write("groundtruth.txt", text));
  }
  std::string MessageOf(std::string_view text) {
    const Result<std::vector<GroundTruthPose>> poses = ReadText(text);
    EXPECT_EQ(poses.code(), StatusCode::kInvalidArgument) << text;
    return poses.status().message();
  }

  TempFolder folder_;
};

TEST_F(GroundTruthTest, TumPosesAreRead) {
  const Result<std::vector<GroundTruthPose>> poses =
      ReadText("# timestamp tx ty tz qx qy qz qw\n0.000000000 1 2 3 0 0 0 1\n0.040000000 4 5 6 0 0 0.70711 0.70711\n");
  ASSERT_TRUE(poses.ok()) << poses.status().ToString();
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ((*poses)[1].timestamp_ns, 40'000'000);
  EXPECT_THAT((*poses)[1].position_in_world, ElementsAre(4, 5, 6));
  // Rounded in the file, of unit length here.
  EXPECT_THAT((*poses)[1].world_from_cam_xyzw, ElementsAre(0, 0, DoubleNear(kHalf, 1e-12), DoubleNear(kHalf, 1e-12)));
}

TEST_F(GroundTruthTest, C3vdMatrixIsReadColumnByColumn) {
  // Camera axes in the world: x along world y, y along -x, z along z (a turn by +90 degrees about z); centre (7, 8, 9).
  const Result<std::vector<GroundTruthPose>> poses =
      ReadText("1,0,0,0,0,1,0,0,0,0,1,0,1.5,2.5,3.5,1\n0,1,0,0,-1,0,0,0,0,0,1,0,7,8,9,1\n");
  ASSERT_TRUE(poses.ok()) << poses.status().ToString();
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ((*poses)[0].timestamp_ns, 0);
  EXPECT_THAT((*poses)[0].position_in_world, ElementsAre(1.5, 2.5, 3.5));
  EXPECT_EQ((*poses)[1].timestamp_ns, 33'366'700);
  EXPECT_THAT((*poses)[1].position_in_world, ElementsAre(7, 8, 9));
  EXPECT_THAT((*poses)[1].world_from_cam_xyzw, ElementsAre(0, 0, DoubleNear(kHalf, 1e-12), DoubleNear(kHalf, 1e-12)));
}

TEST_F(GroundTruthTest, C3vdMatrixWrittenRowByRowIsRefused) {
  EXPECT_THAT(MessageOf("1,0,0,7,0,1,0,8,0,0,1,9,0,0,0,1\n"), HasSubstr("groundtruth.txt:1: values 4, 8, 12 and 16"));
  EXPECT_THAT(MessageOf("2,0,0,0,0,1,0,0,0,0,1,0,7,8,9,1\n"), HasSubstr("is not a rotation"));
  EXPECT_THAT(MessageOf("-1,0,0,0,0,1,0,0,0,0,1,0,7,8,9,1\n"), HasSubstr("is not a rotation"));
}

TEST_F(GroundTruthTest, EurocPosesOfTheBodyBecomePosesOfTheCamera) {
  // The camera sits 0.5 in front of the body's origin along body x and is turned by +90 degrees about body z.
  folder_.Write("mav0/cam0/sensor.yaml",
                "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n"
                "  data: [0, -1, 0, 0.5, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n");
  // The body is at (1, 2, 3), turned by +90 degrees about world z: body x points along world y.
  const std::string path = folder_.Write(
      "mav0/state_groundtruth_estimate0/data.csv",
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v [m]\n"
      "1403636580838555648,1,2,3,0.70710678,0,0,0.70710678,0.1\n");
  const Result<std::vector<GroundTruthPose>> poses = ReadGroundTruth(path);
  ASSERT_TRUE(poses.ok()) << poses.status().ToString();
  ASSERT_EQ(poses->size(), 1u);
  EXPECT_EQ((*poses)[0].timestamp_ns, 1403636580838555648);
  EXPECT_THAT((*poses)[0].position_in_world,
              ElementsAre(DoubleNear(1, 1e-8), DoubleNear(2.5, 1e-8), DoubleNear(3, 1e-8)));
  // 180 degrees about z.
  EXPECT_NEAR(std::abs((*poses)[0].world_from_cam_xyzw[2]), 1.0, 1e-8);
  EXPECT_NEAR((*poses)[0].world_from_cam_xyzw[3], 0.0, 1e-8);
}

TEST_F(GroundTruthTest, EurocPosesWithoutTheCamerasPlaceAreRefused) {
  const Result<std::vector<GroundTruthPose>> poses = ReadGroundTruth(
      folder_.Write("mav0/state_groundtruth_estimate0/data.csv", "1403636580838555648,1,2,3,1,0,0,0\n"));
  EXPECT_EQ(poses.code(), StatusCode::kNotFound);
  EXPECT_THAT(poses.status().message(), HasSubstr("holds poses of the body"));
}

TEST_F(GroundTruthTest, MistakesAreNamedWithTheirLine) {
  EXPECT_THAT(MessageOf("0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0\n"), HasSubstr("groundtruth.txt:2: 7 fields, not 8"));
  EXPECT_THAT(MessageOf("0 1 2 3 0 0 0 1\n\n1 1 nan 3 0 0 0 1\n"), HasSubstr("groundtruth.txt:3: 'nan' is not finite"));
  EXPECT_THAT(MessageOf("0 1 2 3 0 0 0 2\n"), HasSubstr("groundtruth.txt:1: the quaternion has length 2, not 1"));
  EXPECT_THAT(MessageOf("0 1 2 3 0 0 0 0\n"), HasSubstr("the quaternion has length 0"));
  EXPECT_THAT(MessageOf("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n"),
              HasSubstr("groundtruth.txt:2: time stamp 1.000000000 s repeats"));
  EXPECT_THAT(MessageOf("# nothing\n"), HasSubstr("no pose in it"));
}

TEST_F(GroundTruthTest, MissingFileIsNotFound) {
  EXPECT_EQ(ReadGroundTruth(folder_.Path("no.txt")).code(), StatusCode::kNotFound);
}

TEST(Rotation, QuaternionOfAMatrixTurnsVectorsAsTheMatrixDoes) {
  using capture::internal::FromMatrix;
  using capture::internal::Matrix3;
  using capture::internal::Rotate;
  // One matrix for each branch: no turn, half turns about each axis, a general one (axis (1, 2, 2) / 3, 100 degrees).
  const double c = std::cos(100 * M_PI / 180);
  const double s = std::sin(100 * M_PI / 180);
  const double x = 1.0 / 3, y = 2.0 / 3, z = 2.0 / 3;
  const Matrix3 general = {c + x * x * (1 - c),     x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,
                           x * y * (1 - c) + z * s, c + y * y * (1 - c),     y * z * (1 - c) - x * s,
                           x * z * (1 - c) - y * s, y * z * (1 - c) + x * s, c + z * z * (1 - c)};
  for (const Matrix3& r : {Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1}, Matrix3{1, 0, 0, 0, -1, 0, 0, 0, -1},
                           Matrix3{-1, 0, 0, 0, 1, 0, 0, 0, -1}, Matrix3{-1, 0, 0, 0, -1, 0, 0, 0, 1}, general}) {
    const std::array<double, 3> v = {0.3, -1.2, 2.5};
    const std::array<double, 3> turned = Rotate(FromMatrix(r), v);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(turned[i], r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2], 1e-12);
  }
}

}  // namespace
}  // namespace haustra
