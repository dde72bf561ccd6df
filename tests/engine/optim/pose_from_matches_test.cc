#include "engine/optim/pose_from_matches.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

constexpr int kMaxMatches = 200;
constexpr double kSigma = 1.5;

// Points before a camera; of every `num_apart` matches the last shows another point than it says.
class PoseFromMatchesTest : public testing::Test {
 protected:
  void Add(int num, int num_apart) {
    pose_from_matches_.Clear();
    bearings_.clear();
    for (int i = 0; i < num; ++i) {
      Eigen::Vector3d in_cam = PointInSight();
      const Eigen::Vector3d in_map = truth_.Inverse() * in_cam;
      if (i % num_apart == num_apart - 1) in_cam = PointInSight();
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera_.Project(in_cam, &pixel));
      pixel += kSigma * 0.3 * Eigen::Vector2d(Gaussian(rng_), Gaussian(rng_));
      Eigen::Vector3d bearing;
      ASSERT_TRUE(camera_.Unproject(pixel, &bearing));
      pose_from_matches_.Add(in_map, pixel, kSigma);
      bearings_.push_back(bearing);
    }
  }
  Eigen::Vector3d PointInSight() { return {rng_.Uniform(-0.6, 0.6), rng_.Uniform(-0.6, 0.6), rng_.Uniform(0.8, 2.0)}; }
  int NumInliers() const {
    const auto inliers = pose_from_matches_.inliers();
    return static_cast<int>(std::count(inliers.begin(), inliers.end(), 1));
  }
  double Error(const SE3& pose) const { return (pose.InverseTranslation() - truth_.InverseTranslation()).norm(); }

  Rng rng_{5};
  CameraModel camera_ = ColonCamera();
  SE3 truth_ = RandomPose(rng_, 1.0, 1.0);
  PoseFromMatches pose_from_matches_{camera_, kMaxMatches};
  std::vector<Eigen::Vector3d> bearings_;
};

TEST_F(PoseFromMatchesTest, SampleAndFitFindThePoseAndThoseThatAgreeWithIt) {
  Add(150, 3);
  AbsolutePoseRansac::Options options;
  AbsolutePoseRansac::Estimate sampled;
  ASSERT_TRUE(pose_from_matches_.Sample(bearings_, options, rng_, &sampled));
  EXPECT_LT(Error(sampled.cam_from_world), 0.05);
  EXPECT_EQ(NumInliers(), sampled.num_inliers);
  PoseOptimizerResult fitted;
  ASSERT_TRUE(pose_from_matches_.Fit(sampled.cam_from_world, 50, &fitted));
  EXPECT_LT(Error(fitted.cam_from_world), 0.01);
  EXPECT_EQ(NumInliers(), fitted.num_inliers);
  EXPECT_GE(fitted.num_inliers, 90);
  EXPECT_LE(fitted.num_inliers, 105);
}

TEST_F(PoseFromMatchesTest, KeepInliersLeavesWhatAgreed) {
  Add(90, 3);
  PoseOptimizerResult fitted;
  ASSERT_TRUE(pose_from_matches_.Fit(truth_, 30, &fitted));
  std::vector<int> list;
  for (int i = 0; i < 90; ++i) list.push_back(i);
  pose_from_matches_.KeepInliers(&list);
  EXPECT_EQ(static_cast<int>(list.size()), fitted.num_inliers);
  for (const int i : list) EXPECT_EQ(pose_from_matches_.inliers()[i], 1);
}

TEST_F(PoseFromMatchesTest, FitWithTooFewThatAgreeSaysSo) {
  Add(40, 2);
  PoseOptimizerResult fitted;
  EXPECT_FALSE(pose_from_matches_.Fit(truth_, 35, &fitted));
  EXPECT_GE(fitted.num_inliers, 15) << "there was a fit";
}

TEST_F(PoseFromMatchesTest, WithoutAFitNothingAgreesAndTheResultIsUntouched) {
  Add(3, 10);
  PoseOptimizerResult fitted;
  fitted.num_inliers = -7;
  EXPECT_FALSE(pose_from_matches_.Fit(truth_, 3, &fitted));
  EXPECT_EQ(fitted.num_inliers, -7);
  EXPECT_EQ(NumInliers(), 0);
  AbsolutePoseRansac::Estimate sampled;
  sampled.num_inliers = -7;
  EXPECT_FALSE(pose_from_matches_.Sample(bearings_, AbsolutePoseRansac::Options{}, rng_, &sampled));
  EXPECT_EQ(sampled.num_inliers, -7);
  EXPECT_EQ(pose_from_matches_.inliers().size(), 3u);
  EXPECT_EQ(NumInliers(), 0);
}

}  // namespace
}  // namespace haustra::test
