#include "engine/optim/reprojection_cost.h"

#include <gtest/gtest.h>

#include "engine/optim/benchmarks/synthetic_bundle.h"

namespace haustra::optim {
namespace {

struct Sample {
  SE3 cam_from_world{Eigen::Quaterniond(0.9, 0.1, -0.2, 0.05), {0.2, -0.1, 0.4}};
  Eigen::Vector3d point{0.5, -0.3, 1.7};
  BundleObservation observation{.pixel = {300, 200}, .sigma_px = 2.5};
};

Eigen::Vector2d Residual(const ReprojectionCost& cost, const SE3& pose, const Eigen::Vector3d& point) {
  double ambient[LeftSE3Manifold::kAmbientSize];
  LeftSE3Manifold::Store(pose, ambient);
  const double* parameters[] = {ambient, point.data()};
  Eigen::Vector2d residual;
  EXPECT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
  return residual;
}

TEST(ReprojectionCost, JacobiansMatchFiniteDifferencesAlongTheManifold) {
  const CameraModel camera = SyntheticEndoscope();
  const Sample sample;
  const ReprojectionCost cost(camera, sample.observation, 10.0);
  double ambient[LeftSE3Manifold::kAmbientSize];
  LeftSE3Manifold::Store(sample.cam_from_world, ambient);
  const double* parameters[] = {ambient, sample.point.data()};
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 7, Eigen::RowMajor> d_ambient;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
  double* jacobians[] = {d_ambient.data(), d_point.data()};
  ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
  Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
  const LeftSE3Manifold manifold;
  ASSERT_TRUE(manifold.PlusJacobian(ambient, plus.data()));
  const Eigen::Matrix<double, 2, 6> d_pose = d_ambient * plus;

  constexpr double kStep = 1e-6;
  for (int i = 0; i < 6; ++i) {
    Vector6d delta = Vector6d::Zero();
    delta[i] = kStep;
    double moved[LeftSE3Manifold::kAmbientSize];
    ASSERT_TRUE(manifold.Plus(ambient, delta.data(), moved));
    const Eigen::Vector2d ahead = Residual(cost, LeftSE3Manifold::Load(moved), sample.point);
    delta[i] = -kStep;
    ASSERT_TRUE(manifold.Plus(ambient, delta.data(), moved));
    const Eigen::Vector2d behind = Residual(cost, LeftSE3Manifold::Load(moved), sample.point);
    EXPECT_LT((d_pose.col(i) - (ahead - behind) / (2 * kStep)).norm(), 1e-5) << i;
  }
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(i);
    const Eigen::Vector2d difference = Residual(cost, sample.cam_from_world, sample.point + step) -
                                       Residual(cost, sample.cam_from_world, sample.point - step);
    EXPECT_LT((d_point.col(i) - difference / (2 * kStep)).norm(), 1e-5) << i;
  }
}

TEST(ReprojectionCost, UnseenPointGivesTheConstantAndNoGradient) {
  const CameraModel camera = SyntheticEndoscope();
  const ReprojectionCost cost(camera, Sample().observation, 24.5);
  double ambient[LeftSE3Manifold::kAmbientSize];
  LeftSE3Manifold::Store(SE3(), ambient);
  const Eigen::Vector3d behind(0.0, 0.0, -1.0);
  const double* parameters[] = {ambient, behind.data()};
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 7, Eigen::RowMajor> d_pose;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
  double* jacobians[] = {d_pose.data(), d_point.data()};
  ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
  EXPECT_EQ(residual.norm(), 24.5);
  EXPECT_TRUE(d_pose.isZero(0));
  EXPECT_TRUE(d_point.isZero(0));
}

TEST(ReprojectionCost, DroppedObservationCountsNothing) {
  const CameraModel camera = SyntheticEndoscope();
  const Sample sample;
  ReprojectionCost cost(camera, sample.observation, 24.5);
  ASSERT_GT(Residual(cost, sample.cam_from_world, sample.point).norm(), 0);
  cost.Drop();
  EXPECT_EQ(Residual(cost, sample.cam_from_world, sample.point).norm(), 0);
  EXPECT_EQ(Residual(cost, SE3(), {0, 0, -1}).norm(), 0);
}

TEST(LeftSE3Manifold, MinusUndoesPlus) {
  double x[7], y[7];
  LeftSE3Manifold::Store(Sample().cam_from_world, x);
  Vector6d delta;
  delta << 0.1, -0.2, 0.3, 0.5, -0.4, 0.3;
  const LeftSE3Manifold manifold;
  ASSERT_TRUE(manifold.Plus(x, delta.data(), y));
  Vector6d back;
  ASSERT_TRUE(manifold.Minus(y, x, back.data()));
  EXPECT_LT((back - delta).norm(), 1e-12);
}

}  // namespace
}  // namespace haustra::optim
