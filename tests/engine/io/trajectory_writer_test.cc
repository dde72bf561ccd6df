#include "engine/io/trajectory_writer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <vector>

namespace haustra {
namespace {

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// A camera at (1, 2, 3), turned by 90 degrees about the world's z axis.
StampedPose TurnedCamera() {
  const Eigen::Quaterniond world_from_cam(Eigen::AngleAxisd(std::acos(-1.0) / 2, Eigen::Vector3d::UnitZ()));
  const Eigen::Vector3d centre(1, 2, 3);
  return {40000000, SE3(world_from_cam.conjugate(), -(world_from_cam.conjugate() * centre))};
}

TEST(WriteTum, LineHoldsCameraCentreAndWorldFromCam) {
  StringSink sink;
  ASSERT_TRUE(WriteTum(sink, std::vector<StampedPose>{TurnedCamera()}).ok());
  std::istringstream line(Lines(sink.bytes()).back());
  std::string time;
  double t[3], q[4];
  line >> time >> t[0] >> t[1] >> t[2] >> q[0] >> q[1] >> q[2] >> q[3];
  EXPECT_EQ(time, "0.040000000");
  EXPECT_NEAR(t[0], 1, 1e-12);
  EXPECT_NEAR(t[1], 2, 1e-12);
  EXPECT_NEAR(t[2], 3, 1e-12);
  EXPECT_NEAR(q[0], 0, 1e-12);
  EXPECT_NEAR(q[1], 0, 1e-12);
  EXPECT_NEAR(q[2], std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(q[3], std::sqrt(0.5), 1e-12);
}

TEST(WriteTum, LineHasEightColumnsAndNoTrailingBlank) {
  StringSink sink;
  ASSERT_TRUE(WriteTum(sink, std::vector<StampedPose>{TurnedCamera()}).ok());
  const std::string line = Lines(sink.bytes()).back();
  EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 7);
  EXPECT_NE(line.back(), ' ');
  EXPECT_EQ(sink.bytes().back(), '\n');
}

TEST(WriteTum, BothSignsOfAQuaternionGiveTheSameLine) {
  StampedPose pose = TurnedCamera();
  std::string one, other;
  AppendTumLine(pose, &one);
  pose.cam_from_world.rotation.coeffs() *= -1.0;
  AppendTumLine(pose, &other);
  EXPECT_EQ(one, other);
}

TEST(WriteTum, EveryLineOfTheCommentIsAComment) {
  StringSink sink;
  ASSERT_TRUE(WriteTum(sink, {}, "map 3\nfinal poses").ok());
  const std::vector<std::string> lines = Lines(sink.bytes());
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0], "# map 3");
  EXPECT_EQ(lines[1], "# final poses");
  EXPECT_EQ(lines[2].front(), '#');
}

TEST(WriteTum, PoseThatIsNotFiniteIsRefused) {
  std::vector<StampedPose> poses(3, TurnedCamera());
  poses[2].cam_from_world.translation.y() = std::numeric_limits<double>::quiet_NaN();
  StringSink sink;
  const Status status = WriteTum(sink, poses);
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), "trajectory: pose 2 is not finite");
  EXPECT_EQ(sink.bytes(), "");
}

}  // namespace
}  // namespace haustra
