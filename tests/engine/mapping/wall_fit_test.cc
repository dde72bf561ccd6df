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

// A fold ends before a wall that is 1.4 times as far away. Features of its edge lie up to 6 pixels beyond it, and the
// wall has none in the strip that only some keyframes see.
TEST_F(WallFitTest, EdgeOfAFoldIsNotBridged) {
  const Eigen::Vector2d edge(360.0, 270.0);
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector2d at = edge + Eigen::Vector2d(rng_.Uniform(-90.0, 90.0), rng_.Uniform(-90.0, 90.0));
    const double beyond_px = at.x() - edge.x();
    if (beyond_px > 6.0 && beyond_px < 14.0) continue;
    AddPoint(Ray(at) * ((beyond_px <= 6.0 ? 2.0 : 2.8) / Ray(at).z()) * (1.0 + 0.03 * Gaussian(rng_)));
  }
  for (const double y : {-30.0, 0.0, 30.0}) {
    for (const double beside : {-12.0, 8.0}) {
      const Eigen::Vector2d pixel = edge + Eigen::Vector2d(beside, y);
      const Result<FittedWall> patch = Fit(pixel);
      ASSERT_TRUE(patch.ok()) << patch.status().ToString();
      EXPECT_NEAR(patch->distance * Ray(pixel).z() / (beside < 0.0 ? 2.0 : 2.8), 1.0, 0.03) << pixel.transpose();
    }
  }
}

// Half of the points lie on a slope: a bend of the wall is no edge, and neither side is pulled to the other.
TEST_F(WallFitTest, BendOfTheWallIsFollowed) {
  const Eigen::Vector2d ridge(360.0, 270.0);
  for (int i = 0; i < 240; ++i) {
    const Eigen::Vector2d at = ridge + Eigen::Vector2d(rng_.Uniform(-90.0, 90.0), rng_.Uniform(-90.0, 90.0));
    const Eigen::Vector3d ray = Ray(at);
    AddPoint(ray * (at.x() < ridge.x() ? 2.0 / ray.z() : 2.0 / (ray.z() - 0.8 * ray.x())) *
             (1.0 + 0.03 * Gaussian(rng_)));
  }
  for (const double beside : {-40.0, -9.0, 9.0, 40.0}) {
    const Eigen::Vector2d pixel = ridge + Eigen::Vector2d(beside, 0.0);
    const Eigen::Vector3d ray = Ray(pixel);
    const Result<FittedWall> patch = Fit(pixel);
    ASSERT_TRUE(patch.ok()) << patch.status().ToString();
    EXPECT_NEAR(patch->distance / (beside < 0.0 ? 2.0 / ray.z() : 2.0 / (ray.z() - 0.8 * ray.x())), 1.0, 0.03);
  }
}

// Walls at a slant of 60 degrees, of each of which sixteen points are known. They are no fold with a wall behind it.
TEST_F(WallFitTest, FewPointsOfASlantedWallAreEnough) {
  std::vector<Eigen::Vector2d> pixels;
  for (const double y : {135.0, 405.0}) {
    for (const double x : {100.0, 270.0, 440.0, 610.0}) {
      const Eigen::Vector2d pixel(x, y);
      const Eigen::Vector3d ray = Ray(pixel), up = ray.cross(Eigen::Vector3d::UnitX()).normalized();
      const double around = 0.7 * static_cast<double>(pixels.size());
      const Eigen::Vector3d across = std::cos(around) * up + std::sin(around) * ray.cross(up);
      const Eigen::Vector3d normal = ray + std::sqrt(3.0) * across;
      AddPlane(pixel, 65.0, 16, normal, 2.0, 0.02);
      pixels.push_back(pixel);
    }
  }
  for (const Eigen::Vector2d& pixel : pixels) {
    const Result<FittedWall> patch = Fit(pixel);
    ASSERT_TRUE(patch.ok()) << patch.status().ToString();
    EXPECT_NEAR(patch->distance / 2.0, 1.0, 0.08) << pixel.transpose();
  }
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
