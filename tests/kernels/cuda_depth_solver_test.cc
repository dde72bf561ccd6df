// The depth of a keyframe on a CUDA device against the engine's own search and against the truth of a scene that is a
// formula.
#include "kernels/cuda/cuda_depth_solver.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/engine/surface/depth_scene.h"
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
    scene_ = std::make_unique<DepthScene>(GetParam().calibration(), GetParam().wall, 0.15);
  }
  DepthMap MatchFrom(int reference, const std::vector<DepthView>& sources) {
    DepthMap map(matcher().width(), matcher().height());
    EXPECT_TRUE(matcher().Match(scene_->View(reference), sources, scene_->Seeds(), &map).ok());
    return map;
  }
  DepthMap Match() { return MatchFrom(0, scene_->Sources()); }
  DepthMatcher& matcher() const { return scene_->matcher(); }

  std::unique_ptr<DepthScene> scene_;
};

TEST_P(CudaDepthSolverTest, FindsWhatTheHostFinds) {
  const DepthMap host = Match();
  auto solver = CreateCudaDepthSolver(matcher().solver_plan());
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  matcher().SearchOn(solver->get());
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
  EXPECT_LT(scene_->Judge(device).median, 1.1 * scene_->Judge(host).median + 2e-4);
}

TEST_P(CudaDepthSolverTest, RepeatsToTheBitWhateverWasMatchedBefore) {
  auto solver = CreateCudaDepthSolver(matcher().solver_plan());
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  matcher().SearchOn(solver->get());
  const DepthMap first = Match();
  MatchFrom(1, {scene_->View(0), scene_->View(3)});
  const DepthMap again = Match();
  for (int cell = 0; cell < first.num_cells(); ++cell) {
    ASSERT_EQ(first.inverse_range(cell), again.inverse_range(cell));
    ASSERT_EQ(first.confidence(cell), again.confidence(cell));
  }
}

TEST_P(CudaDepthSolverTest, RefusesWhatItWasNotMadeFor) {
  DepthSolverPlan plan = matcher().solver_plan();
  auto solver = CreateCudaDepthSolver(plan);
  ASSERT_TRUE(solver.ok()) << solver.status().ToString();
  std::vector<float> ranges(plan.cells.size());
  std::vector<std::uint8_t> confidences(plan.cells.size());
  DepthProblem problem;
  problem.reference = scene_->View(0).grey;
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
