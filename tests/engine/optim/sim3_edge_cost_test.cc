#include "engine/optim/sim3_edge_cost.h"

#include <gtest/gtest.h>

namespace haustra::optim {
namespace {

using Ambient = Eigen::Vector<double, LeftSim3Manifold::kAmbientSize>;
using Tangent = Eigen::Vector<double, LeftSim3Manifold::kTangentSize>;

Ambient ToAmbient(const Sim3& transform) {
  Ambient out;
  LeftSim3Manifold::Store(transform, out.data());
  return out;
}

Tangent Residual(const Sim3EdgeCost& cost, const Ambient& a, const Ambient& b) {
  const double* parameters[] = {a.data(), b.data()};
  Tangent residual;
  EXPECT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
  return residual;
}

TEST(Sim3EdgeCost, AgreeingNodesGiveZero) {
  const Sim3 a_from_world(1.3, ExpSO3({0.4, -0.2, 0.9}), {1, 2, 3});
  const Sim3 b_from_world(0.7, ExpSO3({-0.5, 0.6, 0.1}), {-2, 0.5, 1});
  const Sim3EdgeCost cost(b_from_world * a_from_world.Inverse(), 2.0, 0.5);
  EXPECT_LT(Residual(cost, ToAmbient(a_from_world), ToAmbient(b_from_world)).norm(), 1e-12);
}

TEST(Sim3EdgeCost, JacobiansMatchFiniteDifferencesAlongTheManifold) {
  const LeftSim3Manifold manifold;
  // From small errors to nearly half a turn.
  for (const double angle : {1e-7, 1e-3, 0.5, 2.0, 3.0}) {
    const Ambient a = ToAmbient(Sim3(1.3, ExpSO3({0.4, -0.2, 0.9}), {1, 2, 3}));
    const Ambient b = ToAmbient(Sim3(0.7, ExpSO3({-0.5, 0.6, 0.1}), {-2, 0.5, 1}));
    const Sim3 agreeing = LeftSim3Manifold::Load(b.data()) * LeftSim3Manifold::Load(a.data()).Inverse();
    const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
    const Sim3EdgeCost cost(Sim3(1.2, ExpSO3(angle * axis), {0.3, 0.1, -0.2}) * agreeing, 1.7, 0.8);
    Eigen::Matrix<double, 7, 8, Eigen::RowMajor> d_a, d_b;
    double* jacobians[] = {d_a.data(), d_b.data()};
    const double* parameters[] = {a.data(), b.data()};
    Tangent residual;
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    constexpr double kStep = 1e-6;
    for (int i = 0; i < LeftSim3Manifold::kTangentSize; ++i) {
      const Tangent step = kStep * Tangent::Unit(i);
      const Tangent back = -step;
      Ambient ahead, behind;
      ASSERT_TRUE(manifold.Plus(a.data(), step.data(), ahead.data()));
      ASSERT_TRUE(manifold.Plus(a.data(), back.data(), behind.data()));
      const Tangent of_a = (Residual(cost, ahead, b) - Residual(cost, behind, b)) / (2 * kStep);
      EXPECT_LT((d_a.col(i) - of_a).norm(), 1e-6) << "a, " << angle << ", " << i;
      ASSERT_TRUE(manifold.Plus(b.data(), step.data(), ahead.data()));
      ASSERT_TRUE(manifold.Plus(b.data(), back.data(), behind.data()));
      const Tangent of_b = (Residual(cost, a, ahead) - Residual(cost, a, behind)) / (2 * kStep);
      EXPECT_LT((d_b.col(i) - of_b).norm(), 1e-6) << "b, " << angle << ", " << i;
    }
    EXPECT_TRUE(d_a.col(7).isZero(0));
    EXPECT_TRUE(d_b.col(7).isZero(0));
  }
}

TEST(LeftSim3Manifold, MinusUndoesPlus) {
  const LeftSim3Manifold manifold;
  const Ambient x = ToAmbient(Sim3(1.3, ExpSO3({0.4, -0.2, 0.9}), {1, 2, 3}));
  Tangent delta;
  delta << 0.1, -0.2, 0.3, 0.5, -0.4, 0.3, -0.2;
  Ambient y;
  ASSERT_TRUE(manifold.Plus(x.data(), delta.data(), y.data()));
  Tangent back;
  ASSERT_TRUE(manifold.Minus(y.data(), x.data(), back.data()));
  EXPECT_LT((back - delta).norm(), 1e-12);
}

}  // namespace
}  // namespace haustra::optim
