// The depth of a keyframe on a CUDA device against the engine's own search and against the truth of a scene that is a
// formula.
#include "kernels/cuda/cuda_depth_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "engine/surface/depth_matcher.h"
#include "tests/engine/surface/textured_scene.h"
#include "tests/kernels/cuda_device_present.h"

namespace haustra {
namespace {

CameraCalibration SmallOcam() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kOcamCalib;
  calibration.width_px = 200;
  calibration.height_px = 160;
  calibration.cx = 99.5;
  calibration.cy = 79.5;
  calibration.coefficients = {110.0, -1.6e-3, 2e-6, -4e-9, 1.0, 0.0, 0.0};
  return calibration;
}

struct Case {
  const char* name;
  CameraCalibration (*calibration)();
  Wall wall;
};
void PrintTo(const Case& each, std::ostream* out) { *out << each.name; }

class CudaDepthSolverTest : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    if (!testing::IsCudaDevicePresent()) GTEST_SKIP() << testing::NoCudaDeviceReason();
    camera_ = *CameraModel::Create(GetParam().calibration());
    matcher_ = std::make_unique<DepthMatcher>(camera_, ImageView{}, DepthOptions());
    const std::vector<Eigen::Vector3d> centres{
        {0, 0, 0}, {0.25, 0, 0}, {-0.2, 0.1, 0}, {0.05, -0.25, 0.05}, {0.1, 0.15, -0.1}};
    for (std::size_t i = 0; i < centres.size(); ++i) {
      const double angle = i == 0 ? 0.0 : 0.02 * static_cast<double>(i - 1);
      poses_.push_back(SE3(ExpSO3(angle * Eigen::Vector3d(1, -1, 2)), centres[i]).Inverse());
      pictures_.push_back(
          TakePicture(GetParam().wall, camera_, poses_.back(), 0.15, 1.0 - 0.1 * static_cast<double>(i)));
    }
    for (std::size_t i = 1; i < poses_.size(); ++i) sources_.push_back({pictures_[i].view(), poses_[i]});
    for (int cell = 11; cell < matcher_->width() * matcher_->height(); cell += 23) {
      if (!(TrueRange(cell) > 0.0)) continue;
      const double off = 1.0 + 0.04 * (static_cast<int>(seeds_.size()) % 5 - 2);
      seeds_.push_back({Eigen::Vector2d(cell % matcher_->width(), cell / matcher_->width()), matcher_->bearing(cell),
                        off / TrueRange(cell)});
    }
  }
  double TrueRange(int cell) const { return GetParam().wall(Eigen::Vector3d::Zero(), matcher_->bearing(cell)); }
  DepthMap Match() {
    DepthMap map(matcher_->width(), matcher_->height());
    EXPECT_TRUE(matcher_->Match({pictures_[0].view(), poses_[0]}, sources_, seeds_, &map).ok());
    return map;
  }
  double MedianError(const DepthMap& map) const {
    std::vector<double> errors;
    for (int cell = 0; cell < map.num_cells(); ++cell) {
      if (map.has_depth(cell) && TrueRange(cell) > 0.0)
        errors.push_back(std::abs(map.range_mu(cell) / TrueRange(cell) - 1.0));
    }
    if (errors.empty()) return 1.0;
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    return errors[errors.size() / 2];
  }

  CameraModel camera_;
  std::unique_ptr<DepthMatcher> matcher_;
  std::vector<SE3> poses_;
  std::vector<Picture> pictures_;
  std::vector<DepthView> sources_;
  std::vector<DepthSeed> seeds_;
};

TEST_P(CudaDepthSolverTest, FindsWhatTheHostFinds) {
  const DepthMap host = Match();
  auto solver = CreateCudaDepthSolver(matcher_->solver_plan());
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  matcher_->SearchOn(solver->get());
  const DepthMap device = Match();
  int num_both = 0, num_one = 0, num_alike = 0, num_as_sure = 0;
  for (int cell = 0; cell < host.num_cells(); ++cell) {
    num_one += host.has_depth(cell) != device.has_depth(cell) ? 1 : 0;
    if (!host.has_depth(cell) || !device.has_depth(cell)) continue;
    ++num_both;
    num_alike += std::abs(device.range_mu(cell) / host.range_mu(cell) - 1.0) < 0.01 ? 1 : 0;
    num_as_sure += std::abs(device.confidence(cell) - host.confidence(cell)) <= 16 ? 1 : 0;
  }
  ASSERT_GT(num_both, host.num_cells() / 2);
  // A plane that costs a little less by rounding alone leads to another search.
  EXPECT_LT(num_one, num_both / 50);
  EXPECT_GT(num_alike, 0.95 * num_both);
  EXPECT_GT(num_as_sure, 0.9 * num_both);
  EXPECT_LT(MedianError(device), 1.1 * MedianError(host) + 2e-4);
}

TEST_P(CudaDepthSolverTest, RepeatsToTheBitWhateverWasMatchedBefore) {
  auto solver = CreateCudaDepthSolver(matcher_->solver_plan());
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  matcher_->SearchOn(solver->get());
  const DepthMap first = Match();
  DepthMap other(matcher_->width(), matcher_->height());
  const std::vector<DepthView> two{{pictures_[0].view(), poses_[0]}, sources_[2]};
  ASSERT_TRUE(matcher_->Match({pictures_[1].view(), poses_[1]}, two, seeds_, &other).ok());
  const DepthMap again = Match();
  for (int cell = 0; cell < first.num_cells(); ++cell) {
    ASSERT_EQ(first.inverse_range(cell), again.inverse_range(cell));
    ASSERT_EQ(first.confidence(cell), again.confidence(cell));
  }
}

TEST_P(CudaDepthSolverTest, RefusesWhatItWasNotMadeFor) {
  DepthSolverPlan plan = matcher_->solver_plan();
  auto solver = CreateCudaDepthSolver(plan);
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  std::vector<float> ranges(plan.cells.size());
  std::vector<std::uint8_t> confidences(plan.cells.size());
  DepthProblem problem;
  problem.reference = pictures_[0].view();
  EXPECT_EQ((*solver)->Solve(problem, ranges, confidences).code(), StatusCode::kInvalidArgument);  // no source
  plan.cells = plan.cells.first(5);
  EXPECT_EQ(CreateCudaDepthSolver(plan).status().code(), StatusCode::kInvalidArgument);
}

INSTANTIATE_TEST_SUITE_P(Cameras, CudaDepthSolverTest,
                         ::testing::Values(Case{"Pinhole", SmallPinhole,
                                                PlaneWall(Eigen::Vector3d(0.8, 0.2, 1.0).normalized(), 1.1)},
                                           Case{"Fisheye", SmallFisheye, SphereWall(Eigen::Vector3d(0.1, 0, 0.3), 1.5)},
                                           Case{"Ocam", SmallOcam, SphereWall(Eigen::Vector3d(0.1, 0, 0.3), 1.5)}),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace haustra
