#include "engine/surface/depth_matcher.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/surface/textured_scene.h"

namespace haustra {
namespace {

struct Score {
  double median = 1.0;          // relative error
  double share_within_3 = 0.0;  // of all cells: answered, and off by at most 3 %
};

class DepthMatcherTest : public ::testing::Test {
 protected:
  void Use(const CameraCalibration& calibration, Wall wall, double texture) {
    camera_ = *CameraModel::Create(calibration);
    wall_ = std::move(wall);
    matcher_ = std::make_unique<DepthMatcher>(camera_, ImageView{}, DepthOptions());
    // The reference, and sources around it that are turned a little, too, under another light.
    poses_ = {SE3()};
    const std::vector<Eigen::Vector3d> centres{{0.25, 0, 0}, {-0.2, 0.1, 0}, {0.05, -0.25, 0.05}, {0.1, 0.15, -0.1}};
    for (std::size_t i = 0; i < centres.size(); ++i) {
      const SE3 map_from_cam(ExpSO3(0.02 * static_cast<double>(i) * Eigen::Vector3d(1, -1, 2)), centres[i]);
      poses_.push_back(map_from_cam.Inverse());
    }
    pictures_.clear();
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      pictures_.push_back(TakePicture(wall_, camera_, poses_[i], texture, 1.0 - 0.1 * static_cast<double>(i)));
    }
    depth_ = DepthMap(matcher_->width(), matcher_->height());
  }
  double TrueRange(int cell) const { return wall_(Eigen::Vector3d::Zero(), matcher_->bearing(cell)); }
  // Every 23rd cell has a point, off by up to 8 % in turn: the seeds are no answer.
  std::vector<DepthSeed> Seeds() const {
    std::vector<DepthSeed> seeds;
    for (int cell = 11; cell < matcher_->width() * matcher_->height(); cell += 23) {
      if (!(TrueRange(cell) > 0.0)) continue;
      const double off = 1.0 + 0.04 * (static_cast<int>(seeds.size()) % 5 - 2);
      seeds.push_back({Eigen::Vector2d(cell % matcher_->width(), cell / matcher_->width()), matcher_->bearing(cell),
                       off / TrueRange(cell)});
    }
    return seeds;
  }
  DepthView View(int i) const { return {pictures_[i].view(), poses_[i]}; }
  std::vector<DepthView> Sources() const { return {View(1), View(2), View(3), View(4)}; }
  Score Judge() const {
    std::vector<double> errors;
    int num_good = 0, num_cells = 0;
    for (int cell = 0; cell < depth_.num_cells(); ++cell) {
      if (!(TrueRange(cell) > 0.0)) continue;
      ++num_cells;
      if (!depth_.has_depth(cell)) continue;
      errors.push_back(std::abs(depth_.range_mu(cell) / TrueRange(cell) - 1.0));
      num_good += errors.back() <= 0.03 ? 1 : 0;
    }
    if (errors.empty()) return {};
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    return {errors[errors.size() / 2], static_cast<double>(num_good) / num_cells};
  }

  CameraModel camera_;
  Wall wall_;
  std::unique_ptr<DepthMatcher> matcher_;
  std::vector<SE3> poses_;
  std::vector<Picture> pictures_;
  DepthMap depth_;
};

TEST_F(DepthMatcherTest, SlantedPlaneThroughAPinholeIsFound) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d(1.6, 0.4, 1.0).normalized(), 0.9), 0.08);
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), Seeds(), &depth_).ok());
  EXPECT_LT(Judge().median, 0.003);  // 0.0017; without the slant of the window 0.0043
  EXPECT_GT(Judge().share_within_3, 0.85);
}

TEST_F(DepthMatcherTest, TubeThroughAFisheyeIsFound) {
  Use(SmallFisheye(), TubeWall(1.0), 0.15);
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), Seeds(), &depth_).ok());
  EXPECT_LT(Judge().median, 0.012);
  EXPECT_GT(Judge().share_within_3, 0.7);
}

TEST_F(DepthMatcherTest, SphereThroughAFisheyeIsFoundBitByBitTheSame) {
  Use(SmallFisheye(), SphereWall(Eigen::Vector3d(0.1, 0, 0.3), 1.5), 0.2);
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), Seeds(), &depth_).ok());
  EXPECT_LT(Judge().median, 0.015);
  EXPECT_GT(Judge().share_within_3, 0.9);
  // Nothing of what was matched before is left in the matcher.
  const DepthMap first = depth_;
  ASSERT_TRUE(matcher_->Match(View(1), std::vector<DepthView>{View(0), View(2)}, Seeds(), &depth_).ok());
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), Seeds(), &depth_).ok());
  for (int cell = 0; cell < depth_.num_cells(); ++cell) {
    ASSERT_EQ(depth_.inverse_range(cell), first.inverse_range(cell));
    ASSERT_EQ(depth_.confidence(cell), first.confidence(cell));
  }
}

TEST_F(DepthMatcherTest, AWallHiddenFromOneSourceIsFoundByTheOthers) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), 0.15);
  Picture other = TakePicture(PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), camera_, poses_[1], 0.05, 0.7);
  const std::vector<DepthView> sources{{other.view(), poses_[1]}, View(2), View(3), View(4)};
  ASSERT_TRUE(matcher_->Match(View(0), sources, Seeds(), &depth_).ok());
  EXPECT_LT(Judge().median, 0.006);
}

TEST_F(DepthMatcherTest, WithoutParallaxThereIsNoDepth) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), 0.15);
  ASSERT_TRUE(matcher_->Match(View(0), std::vector<DepthView>{View(0)}, Seeds(), &depth_).ok());
  for (int cell = 0; cell < depth_.num_cells(); ++cell) ASSERT_FALSE(depth_.has_depth(cell));
}

TEST_F(DepthMatcherTest, AWallWithoutTextureIsNotTrusted) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), 0.15);
  for (Picture& picture : pictures_) std::fill(picture.pixels.begin(), picture.pixels.end(), std::uint8_t{120});
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), Seeds(), &depth_).ok());
  for (int cell = 0; cell < depth_.num_cells(); ++cell) ASSERT_LE(depth_.confidence(cell), 1);
}

TEST_F(DepthMatcherTest, HiddenByTheMaskHasNoDepth) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), 0.15);
  Picture mask{std::vector<std::uint8_t>(200 * 160, 255), 200, 160};
  for (int y = 0; y < 160; ++y) std::fill_n(&mask.pixels[y * 200], 100, std::uint8_t{0});
  matcher_ = std::make_unique<DepthMatcher>(camera_, mask.view(), DepthOptions());
  std::vector<DepthSeed> seeds;
  for (int cell = 30; cell < 2000; cell += 50) {
    if (matcher_->bearing(cell).norm() > 0)
      seeds.push_back({Eigen::Vector2d(cell % 50, cell / 50), matcher_->bearing(cell), 1 / TrueRange(cell)});
  }
  ASSERT_TRUE(matcher_->Match(View(0), Sources(), seeds, &depth_).ok());
  int num_shown = 0;
  for (int cell = 0; cell < depth_.num_cells(); ++cell) {
    if (cell % 50 < 25) {
      ASSERT_FALSE(depth_.has_depth(cell)) << cell;
    } else {
      num_shown += depth_.has_depth(cell) ? 1 : 0;
    }
  }
  EXPECT_GT(num_shown, 800);
}

TEST_F(DepthMatcherTest, BadInputIsRefused) {
  Use(SmallPinhole(), PlaneWall(Eigen::Vector3d::UnitZ(), 2.0), 0.15);
  const std::vector<DepthSeed> seeds = Seeds();
  EXPECT_EQ(matcher_->Match(View(0), {}, seeds, &depth_).code(), StatusCode::kFailedPrecondition);
  EXPECT_EQ(matcher_->Match(View(0), Sources(), std::span(seeds).first(7), &depth_).code(),
            StatusCode::kFailedPrecondition);
  DepthMap small(10, 10);
  EXPECT_EQ(matcher_->Match(View(0), Sources(), seeds, &small).code(), StatusCode::kInvalidArgument);
  DepthView wide = View(0);
  wide.grey.width = 100;
  EXPECT_EQ(matcher_->Match(wide, Sources(), seeds, &depth_).code(), StatusCode::kInvalidArgument);
}

TEST(DepthOptions, EachFieldOutOfRangeIsNamed) {
  EXPECT_TRUE(DepthOptions().Validate().ok());
  const auto message = [](auto change) {
    DepthOptions options;
    change(options);
    return options.Validate().message();
  };
  EXPECT_NE(message([](DepthOptions& o) { o.step_px = 0; }).find("step_px"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.window_radius = 6; }).find("window_radius"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.window_step_px = 0; }).find("window_step_px"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.num_iterations = 0; }).find("num_iterations"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.max_sources = 13; }).find("max_sources"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.best_sources = 7; }).find("best_sources"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.noise_grey = 0; }).find("noise_grey"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.smoothness = -1; }).find("smoothness"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.smooth_step = 0; }).find("smooth_step"), std::string::npos);
  EXPECT_NE(message([](DepthOptions& o) { o.min_parallax_deg = 0; }).find("min_parallax_deg"), std::string::npos);
}

}  // namespace
}  // namespace haustra
