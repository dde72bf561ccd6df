#include "tools/evaluate/colmap_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/run_folder.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

// Two keyframes (ids 4 and 9) on the z axis; points straight ahead of both.
MapExport SmallMap() {
  MapExport map;
  map.calibration = WideCamera();
  map.calibration.coefficients = {0.01, -0.02, 0.003, 0.0004};
  for (const int id : {4, 9}) {
    KeyframeExport keyframe;
    keyframe.id = id;
    keyframe.image_name = "000001.jpg";
    // Camera centre at z = id - 4, turned about its axis so that the rotation counts.
    keyframe.cam_from_map =
        SE3(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(0, 0, -(id - 4.0)));
    keyframe.keypoints.resize(3, {10, 10});
    keyframe.point_ids = {0, 1, 2};
    map.keyframes.push_back(keyframe);
  }
  for (int i = 0; i < 3; ++i) {
    PointExport point;
    point.id = i;
    point.position = {0, 0, 10.0 + 10.0 * i};
    point.track = {{4, i}, {9, i}};
    map.points.push_back(point);
  }
  return map;
}

class ColmapReaderTest : public ::testing::Test {
 protected:
  void SetUp() override { Write(SmallMap()); }
  void Write(const MapExport& map) {
    StringSink cameras, images, points;
    ASSERT_TRUE(WriteColmapCameras(cameras, *MakeColmapCamera(map.calibration)).ok());
    ASSERT_TRUE(WriteColmapImages(images, map).ok());
    ASSERT_TRUE(WriteColmapPoints3D(points, map).ok());
    folder_.Write("cameras.txt", cameras.bytes());
    folder_.Write("images.txt", images.bytes());
    folder_.Write("points3D.txt", points.bytes());
  }
  TextFolder folder_;
};

TEST_F(ColmapReaderTest, CameraComesBackWithOurPixelOrigin) {
  const Result<MapGeometry> geometry = ReadColmapGeometry(folder_.path());
  ASSERT_TRUE(geometry.ok()) << geometry.status().ToString();
  EXPECT_EQ(geometry->camera.kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(geometry->camera.width_px, 720);
  EXPECT_NEAR(geometry->camera.cx, 359.5, 1e-9);
  EXPECT_EQ(geometry->camera.coefficients[3], 0.0004);
}

TEST_F(ColmapReaderTest, DepthIsTheMedianDistanceByKeyframe) {
  const Result<MapGeometry> geometry = ReadColmapGeometry(folder_.path());
  ASSERT_TRUE(geometry.ok()) << geometry.status().ToString();
  EXPECT_NEAR(geometry->keyframe_depth_mu.at(4), 20.0, 1e-9);
  EXPECT_NEAR(geometry->keyframe_depth_mu.at(9), 15.0, 1e-9);
  EXPECT_NEAR(geometry->depth_mu, 17.5, 1e-9);
}

TEST_F(ColmapReaderTest, PinholeCamerasComeBack) {
  MapExport map = SmallMap();
  map.calibration.kind = CameraModelKind::kPinhole;
  map.calibration.coefficients = {0.1, 0.02, 0.003, 0.004, 0.005};
  Write(map);
  const Result<MapGeometry> geometry = ReadColmapGeometry(folder_.path());
  ASSERT_TRUE(geometry.ok()) << geometry.status().ToString();
  EXPECT_EQ(geometry->camera.kind, CameraModelKind::kPinhole);
  EXPECT_EQ(geometry->camera.coefficients[4], 0.005);
}

TEST_F(ColmapReaderTest, MapWithoutPointsHasNoDepth) {
  MapExport map = SmallMap();
  map.points.clear();
  for (KeyframeExport& keyframe : map.keyframes) {
    keyframe.keypoints.clear();
    keyframe.point_ids.clear();
  }
  Write(map);
  const Result<MapGeometry> geometry = ReadColmapGeometry(folder_.path());
  ASSERT_TRUE(geometry.ok()) << geometry.status().ToString();
  EXPECT_EQ(geometry->depth_mu, 0.0);
  EXPECT_TRUE(geometry->keyframe_depth_mu.empty());
}

TEST_F(ColmapReaderTest, MalformedFilesAreNamedWithTheirLine) {
  folder_.Write("cameras.txt", "# c\n1 SIMPLE_RADIAL 720 540 1 2 3 4\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("cameras.txt:2: camera model 'SIMPLE"));
  folder_.Write("cameras.txt", "1 OPENCV_FISHEYE 720 540 398 398 360 x 0 0 0 0\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("cameras.txt:1: not a camera"));
  for (const char* size : {"0 540", "-720 540", "720.5 540", "720 6e30", "720 99999999999"}) {
    folder_.Write("cameras.txt", std::string("1 OPENCV_FISHEYE ") + size + " 398 398 360 270 0 0 0 0\n");
    EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("cameras.txt:1: not the size"))
        << size;
  }
  folder_.Write("cameras.txt", "# nothing\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("no camera"));
  Write(SmallMap());
  folder_.Write("images.txt", "5 1 0 0 0 0 0\n\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("images.txt:1: not an image"));
  for (const char* id : {"0", "-9223372036854775808"}) {
    folder_.Write("images.txt", std::string(id) + " 1 0 0 0 0 0 0 1 a.jpg\n\n");
    EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("images.txt:1: not an image")) << id;
  }
  for (const char* rotation : {"0 0 0 0", "1e300 1e300 0 0"}) {
    folder_.Write("images.txt", std::string("5 ") + rotation + " 0 0 0 1 a.jpg\n\n");
    EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("images.txt:1: not a rotation"));
  }
  Write(SmallMap());
  folder_.Write("points3D.txt", "1 0 0 1e300 1 2 3 0.5 5 0\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("points3D.txt:1: farther away"));
  folder_.Write("points3D.txt", "1 0 0 10 1 2 3 0.5 77 0\n");
  EXPECT_THAT(ReadColmapGeometry(folder_.path()).status().message(), HasSubstr("image '77' is not in images.txt"));
  folder_.Remove("points3D.txt");
  EXPECT_EQ(ReadColmapGeometry(folder_.path()).code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra::evaluate
