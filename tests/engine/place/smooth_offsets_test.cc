#include "engine/place/smooth_offsets.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/geometry/synthetic.h"

namespace haustra::test {
namespace {

constexpr double kSigmaPx = 0.7;

// A wall before two cameras, which the map holds twice. The second time it is twisted, more on one side than on the
// other, so that no similarity takes one to the other.
class SmoothOffsetsTest : public testing::Test {
 protected:
  SmoothOffsetsTest() {
    options_.max_offset_px = 0.05 * camera_.focal_px();
    options_.max_roughness = 4.0;
  }

  static Eigen::Vector3d Twisted(const Eigen::Vector3d& p, double twist) {
    return ExpSO3({0.0, 0.0, twist * (1.0 + p.x())}) * p + Eigen::Vector3d(0.6 * twist * p.y() * p.y(), 0.0, 0.0);
  }
  Eigen::Vector2d Seen(const SE3& cam_from_map, const Eigen::Vector3d& point) {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(camera_.Project(cam_from_map * point, &pixel));
    return pixel + kSigmaPx * Eigen::Vector2d(Gaussian(rng_), Gaussian(rng_));
  }
  Eigen::Vector3d OnTheWall() {
    const double x = rng_.Uniform(-0.8, 0.8), y = rng_.Uniform(-0.6, 0.6);
    return {x, y, 1.6 + 0.3 * std::sin(3.0 * x) + 0.2 * y};
  }
  Sim3Match MatchOf(const Eigen::Vector3d& in_a, const Eigen::Vector3d& in_b) {
    Sim3Match match;
    match.point_in_a = in_a;
    match.point_in_b = in_b;
    match.pixel_in_a = Seen(views_a_[0], in_a);
    match.pixel_in_b = Seen(views_b_[0], in_b);
    match.sigma_a_px = match.sigma_b_px = kSigmaPx;
    return match;
  }
  void AddTrue(int num, double twist) {
    for (int i = 0; i < num; ++i) {
      const Eigen::Vector3d point = OnTheWall();
      matches_.push_back(MatchOf(Twisted(point, twist), point));
    }
  }
  // Of another piece of wall nearby, as where texture is alike.
  void AddWrong(int num, double twist) {
    for (int i = 0; i < num; ++i) {
      const Eigen::Vector3d point = OnTheWall();
      const double angle = rng_.Uniform(0.0, 2.0 * std::numbers::pi), distance = rng_.Uniform(0.03, 0.07);
      const Eigen::Vector3d other = point + distance * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
      matches_.push_back(MatchOf(Twisted(other, twist), point));
    }
  }
  SmoothOffsets Keep() {
    kept_.assign(matches_.size(), 9);
    return KeepSmoothOffsets(camera_, matches_, views_a_, views_b_, options_, kept_);
  }
  int NumKept(std::size_t begin, std::size_t end) const {
    return static_cast<int>(std::count(kept_.begin() + static_cast<std::ptrdiff_t>(begin),
                                       kept_.begin() + static_cast<std::ptrdiff_t>(end), std::uint8_t{1}));
  }

  CameraModel camera_ = CameraModel::Create(ColonCalibration()).value();
  Rng rng_{11};
  std::vector<SE3> views_a_{SE3(ExpSO3({0.02, -0.05, 0.7}), {0.05, -0.1, 0.08})};
  std::vector<SE3> views_b_{SE3{}};
  std::vector<Sim3Match> matches_;
  std::vector<std::uint8_t> kept_;
  SmoothOffsetsOptions options_;
};

TEST_F(SmoothOffsetsTest, AWallThatIsTwistedIsKeptAndWrongMatchesAreNot) {
  RecordProperty("req", "MRG-001");
  AddTrue(200, 0.02);
  AddWrong(80, 0.02);
  const SmoothOffsets found = Keep();
  EXPECT_EQ(found.num_kept, NumKept(0, matches_.size()));
  EXPECT_GE(found.num_near, 260);
  EXPECT_GE(NumKept(0, 200), 190);
  EXPECT_LE(NumKept(200, 280), 16);
  // The offsets that were kept are large against what a feature is found to.
  double largest = 0.0;
  for (std::size_t i = 0; i < 200; ++i) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(camera_.Project(views_a_[0] * matches_[i].point_in_b, &pixel));
    if (kept_[i] == 1) largest = std::max(largest, (pixel - matches_[i].pixel_in_a).norm());
  }
  EXPECT_GT(largest, 10.0 * kSigmaPx);
}

TEST_F(SmoothOffsetsTest, WrongMatchesAloneDoNotAgree) {
  RecordProperty("req", "MRG-001");
  AddWrong(200, 0.02);
  const SmoothOffsets found = Keep();
  EXPECT_GE(found.num_near, 180);
  EXPECT_LE(found.num_kept, 50);
}

TEST_F(SmoothOffsetsTest, WhatLiesElsewhereIsNotNear) {
  AddTrue(200, 0.4);
  EXPECT_LE(Keep().num_near, 40);
  EXPECT_EQ(NumKept(0, matches_.size()), Keep().num_kept);
}

TEST_F(SmoothOffsetsTest, AHandfulOfMatchesTellsNothing) {
  AddTrue(options_.min_neighbours, 0.0);
  EXPECT_EQ(Keep().num_near, options_.min_neighbours);
  EXPECT_EQ(NumKept(0, matches_.size()), 0);
  AddTrue(1, 0.0);
  EXPECT_EQ(Keep().num_kept, options_.min_neighbours + 1);
}

}  // namespace
}  // namespace haustra::test
