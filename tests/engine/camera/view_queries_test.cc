#include "engine/camera/view_queries.h"

#include <gtest/gtest.h>

#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

struct Point {
  Eigen::Vector3d position{0.1, -0.05, 2.0};
  Eigen::Vector3d normal{0.0, 0.0, -1.0};
  double scale_times_distance = 8.0;
  DescriptorRef descriptor{FeatureSetHandle{3, 1}, 17};
};

class ViewQueriesTest : public testing::Test {
 protected:
  CameraModel camera_ = ColonCamera();
  MatchingConfig matching_;
  NoiseModel noise_;
  SE3 cam_from_map_{ExpSO3({0.0, 0.1, 0.0}), {0.0, 0.0, 0.5}};
  ViewQueries queries_{matching_, camera_, noise_, cam_from_map_};
};

TEST_F(ViewQueriesTest, PointIsSearchedWhereItProjectsAtItsSizeAsFarAsNoiseReaches) {
  const Point point;
  GuidedQuery query;
  double scale_px = 0.0;
  ASSERT_TRUE(queries_.OfPoint(point, &query, &scale_px));
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera_.Project(cam_from_map_ * point.position, &pixel));
  EXPECT_FLOAT_EQ(query.x_px, static_cast<float>(pixel.x()));
  EXPECT_FLOAT_EQ(query.y_px, static_cast<float>(pixel.y()));
  EXPECT_NEAR(scale_px, 8.0 / (cam_from_map_ * point.position).norm(), 1e-9);
  EXPECT_NEAR(query.radius_px, std::sqrt(kChi2TwoDof) * noise_.SigmaPx(scale_px), 1e-4);
  EXPECT_NEAR(query.min_scale_px * matching_.scale_tolerance, scale_px, 1e-4);
  EXPECT_NEAR(query.max_scale_px / matching_.scale_tolerance, scale_px, 1e-4);
  EXPECT_EQ(query.descriptor.feature_idx, 17);
}

TEST_F(ViewQueriesTest, PointThatTheViewDoesNotShowIsNotSearched) {
  GuidedQuery query;
  Point behind, beside, averted, oblique;
  behind.position.z() = -2.0;
  beside.position.x() = 40.0;
  averted.normal = -averted.normal;
  const double too_oblique = (matching_.max_view_angle_deg + 8.0) * kDegree;
  oblique.normal = {std::sin(too_oblique), 0.0, -std::cos(too_oblique)};
  for (const Point& point : {behind, beside, averted, oblique}) EXPECT_FALSE(queries_.OfPoint(point, &query));
}

TEST_F(ViewQueriesTest, FeatureFromNearbyIsSearchedAtItsOwnSizeWithinTheRadius) {
  const Point point;
  GuidedQuery query;
  ASSERT_TRUE(queries_.OfFeature(point.position, point.descriptor, 5.0f, 31.0, &query));
  EXPECT_FLOAT_EQ(query.radius_px, 31.0f);
  EXPECT_FLOAT_EQ(query.min_scale_px, 5.0f / static_cast<float>(matching_.scale_tolerance));
  EXPECT_FLOAT_EQ(query.max_scale_px, 5.0f * static_cast<float>(matching_.scale_tolerance));
  EXPECT_FALSE(queries_.OfFeature({0.0, 40.0, 2.0}, point.descriptor, 5.0f, 31.0, &query));
}

}  // namespace
}  // namespace haustra::test
