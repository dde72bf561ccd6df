// The wall along a ray, from points of walls that are known.
#include "engine/mapping/wall_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

constexpr int kMaxPoints = 600;

// A view of points that two keyframes see, both from the origin.
class WallFitTest : public testing::Test {
 protected:
  WallFitTest() : camera_(ColonCamera()), atlas_({4, kMaxPoints, 2, 8, kMaxPoints}), fit_(camera_, 2 * kMaxPoints) {
    map_ = atlas_.CreateMap();
    FrameFeatures features(kMaxPoints);
    features.num = kMaxPoints;
    for (KeyframeHandle& keyframe : keyframes_) {
      keyframe = atlas_.AddKeyframe(map_, 0, TimePoint{}, cam_from_map_, features);
    }
  }

  void AddPoint(const Eigen::Vector3d& in_camera) {
    const MapPointHandle point = atlas_.AddPoint(map_, cam_from_map_.Inverse() * in_camera, 0);
    for (const KeyframeHandle keyframe : keyframes_) {
      ASSERT_TRUE(atlas_.AddObservation(point, keyframe, atlas_.keyframe(keyframe).num_points));
    }
  }
  Eigen::Vector3d Ray(const Eigen::Vector2d& pixel) const {
    Eigen::Vector3d ray;
    EXPECT_TRUE(camera_.Unproject(pixel, &ray));
    return ray;
  }
  // Points of the plane normal . x = offset around the pixel, `noise` off along their rays.
  void AddPlane(const Eigen::Vector2d& pixel, double reach_px, int count, const Eigen::Vector3d& normal, double offset,
                double noise) {
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d ray =
          Ray(pixel + Eigen::Vector2d(rng_.Uniform(-reach_px, reach_px), rng_.Uniform(-reach_px, reach_px)));
      AddPoint(ray * (offset / normal.dot(ray)) * (1.0 + noise * Gaussian(rng_)));
    }
  }
  Result<FittedWall> Fit(const Eigen::Vector2d& pixel) {
    fit_.Begin(cam_from_map_);
    fit_.Add(atlas_.keyframe(keyframes_[0]), atlas_);
    return fit_.At(pixel);
  }

  Rng rng_{11};
  CameraModel camera_;
  SE3 cam_from_map_ = RandomPose(rng_, 1.0, 3.0);
  Atlas atlas_;
  MapHandle map_;
  std::array<KeyframeHandle, 2> keyframes_;
  WallFit fit_;
};

TEST_F(WallFitTest, SlantedWallIsFoundWithItsSlope) {
  const Eigen::Vector2d pixel(300.0, 200.0);
  const Eigen::Vector3d normal = Eigen::Vector3d(0.8, 0.3, 1.0).normalized();
  AddPlane(pixel, 60.0, 60, normal, 2.0, 0.01);
  const Result<FittedWall> patch = Fit(pixel);
  ASSERT_TRUE(patch.ok()) << patch.status().ToString();
  const double truth = 2.0 / normal.dot(Ray(pixel));
  EXPECT_NEAR(patch->distance / truth, 1.0, 0.01);
  EXPECT_GT(patch->normal_in_cam.dot(-normal), std::cos(0.2));
  EXPECT_LT(patch->normal_in_cam.dot(Ray(pixel)), 0.0);
}

// A fold in front takes up a third of the picture around the pixel, and does not pull the wall towards it.
TEST_F(WallFitTest, FoldBesideThePixelHasNoSay) {
  const Eigen::Vector2d pixel(360.0, 270.0);
  AddPlane(pixel, 50.0, 40, Eigen::Vector3d::UnitZ(), 3.0, 0.01);
  AddPlane(pixel + Eigen::Vector2d(55.0, 0.0), 20.0, 16, Eigen::Vector3d::UnitZ(), 1.2, 0.01);
  const Result<FittedWall> patch = Fit(pixel);
  ASSERT_TRUE(patch.ok()) << patch.status().ToString();
  EXPECT_NEAR(patch->distance / (3.0 / Ray(pixel).z()), 1.0, 0.02);
}

TEST_F(WallFitTest, FewPointsAreRefused) {
  const Eigen::Vector2d pixel(360.0, 270.0);
  AddPlane(pixel, 30.0, 5, Eigen::Vector3d::UnitZ(), 3.0, 0.0);
  const Result<FittedWall> patch = Fit(pixel);
  EXPECT_EQ(patch.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(patch.status().message(), HasSubstr("too little of the map is near"));
}

TEST_F(WallFitTest, PointsFarFromThePixelAreNotEnough) {
  const Eigen::Vector2d pixel(360.0, 270.0);
  AddPlane(pixel + Eigen::Vector2d(150.0, 0.0), 40.0, 60, Eigen::Vector3d::UnitZ(), 3.0, 0.0);
  EXPECT_EQ(Fit(pixel).code(), StatusCode::kFailedPrecondition);
}

TEST_F(WallFitTest, PointsThatDisagreeAreRefused) {
  const Eigen::Vector2d pixel(360.0, 270.0);
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector2d at = pixel + Eigen::Vector2d(rng_.Uniform(-50.0, 50.0), rng_.Uniform(-50.0, 50.0));
    AddPoint(Ray(at) * std::exp(rng_.Uniform(-1.5, 1.5)));
  }
  const Result<FittedWall> patch = Fit(pixel);
  EXPECT_EQ(patch.code(), StatusCode::kFailedPrecondition);
  EXPECT_THAT(patch.status().message(), HasSubstr("not clear about the wall"));
}

TEST_F(WallFitTest, PixelOutsideTheImageIsRefused) {
  AddPlane({10.0, 10.0}, 8.0, 40, Eigen::Vector3d::UnitZ(), 3.0, 0.0);
  EXPECT_EQ(Fit({-1.0, 10.0}).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra::test
