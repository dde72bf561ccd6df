// Where the depth of keyframes is searched, by the name of the device.
#include <gtest/gtest.h>

#include "engine/surface/depth_matcher.h"
#include "platform/assemble.h"

namespace haustra {
namespace {

CameraModel NarrowCamera() {
  CameraCalibration calibration;
  calibration.width_px = 64;
  calibration.height_px = 48;
  calibration.fx = calibration.fy = 40.0;
  calibration.cx = 31.5;
  calibration.cy = 23.5;
  return *CameraModel::Create(calibration);
}

TEST(DepthSolverChoiceTest, TheCpuNeedsNone) {
  const DepthMatcher matcher(NarrowCamera(), ImageView{}, DepthOptions());
  const auto solver = CreateDepthSolver("cpu", matcher.solver_plan());
  ASSERT_TRUE(solver.ok());
  EXPECT_EQ(solver->get(), nullptr);
}

TEST(DepthSolverChoiceTest, ADeviceThatIsNotThereIsSaid) {
  const DepthMatcher matcher(NarrowCamera(), ImageView{}, DepthOptions());
  EXPECT_EQ(CreateDepthSolver("tpu", matcher.solver_plan()).status().code(), StatusCode::kInvalidArgument);
  if (ResolveVisionDevice("auto") == "cuda") GTEST_SKIP() << "this machine has a CUDA device";
  const Status status = CreateDepthSolver("cuda", matcher.solver_plan()).status();
  EXPECT_EQ(status.code(), StatusCode::kUnavailable);
  EXPECT_NE(status.message().find("use 'cpu'"), std::string::npos) << status.message();
}

}  // namespace
}  // namespace haustra
