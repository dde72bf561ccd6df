#include "engine/io/colmap_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/engine/io/small_map.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> DataLines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("#")) lines.push_back(line);
  }
  return lines;
}

std::vector<std::string> CameraLines(const CameraCalibration& calibration) {
  const Result<ColmapCamera> camera = MakeColmapCamera(calibration);
  EXPECT_TRUE(camera.ok());
  StringSink sink;
  EXPECT_TRUE(WriteColmapCameras(sink, *camera).ok());
  return DataLines(sink.bytes());
}

TEST(ColmapCameras, KannalaBrandtIsOpencvFisheyeWithPixelsFromTheCorner) {
  EXPECT_THAT(CameraLines(SmallMap().calibration),
              ElementsAre("1 OPENCV_FISHEYE 720 540 398.2 397.6 362.9 268.6 -0.045 0.008 -0.0031 5e-04"));
}

TEST(ColmapCameras, RadialTangentialIsOpencv) {
  CameraCalibration calibration = SmallMap().calibration;
  calibration.kind = CameraModelKind::kPinhole;
  calibration.coefficients = {0.1, 0.02, 0.003, 0.004};
  EXPECT_THAT(CameraLines(calibration), ElementsAre("1 OPENCV 720 540 398.2 397.6 362.9 268.6 0.1 0.02 0.003 0.004"));
}

TEST(ColmapCameras, ThirdRadialCoefficientNeedsFullOpencv) {
  CameraCalibration calibration = SmallMap().calibration;
  calibration.kind = CameraModelKind::kPinhole;
  calibration.coefficients = {0.1, 0.02, 0.003, 0.004, 0.005};
  EXPECT_THAT(CameraLines(calibration),
              ElementsAre("1 FULL_OPENCV 720 540 398.2 397.6 362.9 268.6 0.1 0.02 0.003 0.004 0.005 0 0 0"));
}

TEST(ColmapCameras, OcamCalibIsFittedAndTheFileSaysSo) {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kOcamCalib;
  calibration.width_px = 675;
  calibration.height_px = 540;
  calibration.cx = 340;
  calibration.cy = 270;
  calibration.coefficients = {384.0, -1.1e-3, 6.0e-7, -1.0e-9, 1.0, 0.0, 0.0};
  const Result<ColmapCamera> camera = MakeColmapCamera(calibration);
  ASSERT_TRUE(camera.ok()) << camera.status().ToString();
  EXPECT_EQ(camera->model, "OPENCV_FISHEYE");
  EXPECT_TRUE(camera->is_fitted);
  StringSink sink;
  ASSERT_TRUE(WriteColmapCameras(sink, *camera).ok());
  EXPECT_THAT(sink.bytes(), HasSubstr("residual over the image: rms "));
}

TEST(ColmapImages, ImageIsTwoLinesWithWorldToCameraPose) {
  StringSink sink;
  ASSERT_TRUE(WriteColmapImages(sink, SmallMap()).ok());
  EXPECT_THAT(DataLines(sink.bytes()),
              ElementsAre("1 1 0 0 0 0 0 0 1 frames/000000.jpg", "10.75 21 6 30.5 40.5 -1",
                          "13 0.5 0.5 -0.5 0.5 1 2 3 1 frames/000012.jpg", "1.5 2.5 10 11.5 22.5 -1 33.5 44.5 6"));
}

TEST(ColmapImages, KeyframeWithoutKeypointsKeepsItsSecondLine) {
  MapExport map = SmallMap();
  map.points.clear();
  map.keyframes.resize(1);
  map.keyframes[0].keypoints.clear();
  map.keyframes[0].point_ids.clear();
  StringSink sink;
  ASSERT_TRUE(WriteColmapImages(sink, map).ok());
  EXPECT_THAT(DataLines(sink.bytes()), ElementsAre("1 1 0 0 0 0 0 0 1 frames/000000.jpg", ""));
}

TEST(ColmapPoints, PointHasItsTrack) {
  StringSink sink;
  ASSERT_TRUE(WriteColmapPoints3D(sink, SmallMap()).ok());
  EXPECT_THAT(DataLines(sink.bytes()),
              ElementsAre("6 0.5 -1.25 4 200 100 50 0.75 1 0 13 2", "10 0 0 2 128 128 128 0 13 0"));
}

TEST(ColmapImages, InconsistentMapIsRefusedBeforeAnythingIsWritten) {
  MapExport map = SmallMap();
  map.points[0].track.pop_back();
  StringSink sink;
  EXPECT_EQ(WriteColmapImages(sink, map).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(WriteColmapPoints3D(sink, map).code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(sink.bytes(), "");
}

}  // namespace
}  // namespace haustra
