#include <gtest/gtest.h>

#include <numbers>
#include <vector>

#include "engine/geometry/se3.h"
#include "engine/geometry/sim3.h"
#include "tests/geometry/synthetic.h"

namespace haustra {
namespace {

using test::GaussianVector;
using test::RandomPose;

Sim3 RandomSim3(Rng& rng) {
  const SE3 rigid = RandomPose(rng, 3.0, 5.0);
  return Sim3(rng.Uniform(0.2, 5.0), rigid.rotation, rigid.translation);
}

TEST(SE3, ProductActsLikeOneTransformAfterTheOther) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const SE3 b_from_a = RandomPose(rng, 3.0, 5.0), c_from_b = RandomPose(rng, 3.0, 5.0);
    const Eigen::Vector3d p = GaussianVector(rng, 3.0);
    EXPECT_LT(((c_from_b * b_from_a) * p - c_from_b * (b_from_a * p)).norm(), 1e-12);
    // Against plain 4x4 algebra, which shares nothing with the quaternion code.
    Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
    m.topLeftCorner<3, 3>() = b_from_a.matrix3();
    m.topRightCorner<3, 1>() = b_from_a.translation;
    EXPECT_LT((m.inverse() * p.homogeneous() - (b_from_a.Inverse() * p).homogeneous()).norm(), 1e-12);
  }
}

TEST(SE3, InverseTranslationIsTheOriginOfTheOtherFrame) {
  Rng rng(2);
  const SE3 cam_from_world = RandomPose(rng, 3.0, 5.0);
  EXPECT_LT((cam_from_world * cam_from_world.InverseTranslation()).norm(), 1e-13);
}

TEST(SE3, ExpAndLogAreInverseUpToHalfATurn) {
  Rng rng(3);
  for (const double angle : {0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 0.1, 1.0, 3.0, 3.14159}) {
    for (int i = 0; i < 20; ++i) {
      Vector6d tangent;
      tangent << GaussianVector(rng, 2.0), angle * test::RandomDirection(rng);
      EXPECT_LT((SE3::Exp(tangent).Log() - tangent).norm(), 1e-8 * (1.0 + tangent.norm())) << angle;
    }
  }
}

TEST(SE3, ExpMatchesTheMatrixExponentialSeries) {
  Rng rng(4);
  for (int i = 0; i < 20; ++i) {
    Vector6d tangent;
    tangent << GaussianVector(rng, 1.0), GaussianVector(rng, 0.7);
    Eigen::Matrix4d generator = Eigen::Matrix4d::Zero(), power = Eigen::Matrix4d::Identity(), sum = power;
    generator.topLeftCorner<3, 3>() = Skew(tangent.tail<3>());
    generator.topRightCorner<3, 1>() = tangent.head<3>();
    for (int n = 1; n < 40; ++n) {
      power = power * generator / n;
      sum += power;
    }
    const SE3 pose = SE3::Exp(tangent);
    EXPECT_LT((pose.matrix3() - sum.topLeftCorner<3, 3>()).norm(), 1e-11);
    EXPECT_LT((pose.translation - sum.topRightCorner<3, 1>()).norm(), 1e-11);
  }
}

TEST(SE3, RotationAngleIsTheSameForBothQuaternionsOfARotation) {
  const Eigen::Quaterniond a = ExpSO3({0.1, 0.2, 0.3});
  const Eigen::Quaterniond b = ExpSO3({0.0, 0.0, 0.5}) * a;
  const Eigen::Quaterniond minus_b(-b.w(), -b.x(), -b.y(), -b.z());
  EXPECT_NEAR(RotationAngle(a, b), 0.5, 1e-12);
  EXPECT_NEAR(RotationAngle(a, minus_b), 0.5, 1e-12);
}

TEST(Sim3, GroupLawsHold) {
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const Sim3 b_from_a = RandomSim3(rng), c_from_b = RandomSim3(rng);
    const Eigen::Vector3d p = GaussianVector(rng, 3.0);
    EXPECT_LT(((c_from_b * b_from_a) * p - c_from_b * (b_from_a * p)).norm(), 1e-10);
    EXPECT_LT((b_from_a.Inverse() * (b_from_a * p) - p).norm(), 1e-10);
  }
}

TEST(Sim3, TransformedPoseSeesTransformedPointsInTheSameDirection) {
  Rng rng(6);
  for (int i = 0; i < 100; ++i) {
    const Sim3 b_from_a = RandomSim3(rng);
    const SE3 cam_from_a = RandomPose(rng, 3.0, 5.0);
    const Eigen::Vector3d p = GaussianVector(rng, 3.0);
    const Eigen::Vector3d seen = TransformPose(cam_from_a, b_from_a) * (b_from_a * p);
    EXPECT_LT((seen - b_from_a.scale * (cam_from_a * p)).norm(), 1e-10);
  }
}

TEST(AlignSim3, RecoversTheSimilarityFromThreePointsAndMore) {
  Rng rng(7);
  for (int trial = 0; trial < 500; ++trial) {
    const Sim3 truth = RandomSim3(rng);
    const int count = 3 + static_cast<int>(rng.UniformInt(20));
    std::vector<Eigen::Vector3d> a(count), b(count);
    for (int i = 0; i < count; ++i) {
      a[i] = GaussianVector(rng, 2.0);
      b[i] = truth * a[i];
    }
    Sim3 estimate;
    ASSERT_TRUE(AlignSim3(a, b, &estimate));
    EXPECT_NEAR(estimate.scale, truth.scale, 1e-6 * truth.scale);
    EXPECT_LT(RotationAngle(estimate.rotation, truth.rotation), 1e-6);
    EXPECT_LT((estimate.translation - truth.translation).norm(), 1e-5);
  }
}

TEST(AlignSim3, FlatPointsGiveARotationNotAReflection) {
  Rng rng(8);
  for (int trial = 0; trial < 100; ++trial) {
    const Sim3 truth = RandomSim3(rng);
    std::vector<Eigen::Vector3d> a(10), b(10);
    for (int i = 0; i < 10; ++i) {
      a[i] = GaussianVector(rng, 2.0);
      a[i].z() = 0.0;
      b[i] = truth * a[i] + GaussianVector(rng, 1e-4);
    }
    Sim3 estimate;
    ASSERT_TRUE(AlignSim3(a, b, &estimate));
    EXPECT_NEAR(estimate.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
    EXPECT_LT(RotationAngle(estimate.rotation, truth.rotation), 1e-2);
  }
}

TEST(AlignSim3, IsTheLeastSquaresOptimum) {
  Rng rng(9);
  const Sim3 truth = RandomSim3(rng);
  std::vector<Eigen::Vector3d> a(30), b(30);
  for (int i = 0; i < 30; ++i) {
    a[i] = GaussianVector(rng, 2.0);
    b[i] = truth * a[i] + GaussianVector(rng, 0.3);
  }
  const auto cost = [&](const Sim3& s) {
    double sum = 0.0;
    for (int i = 0; i < 30; ++i) sum += (s * a[i] - b[i]).squaredNorm();
    return sum;
  };
  Sim3 estimate;
  ASSERT_TRUE(AlignSim3(a, b, &estimate));
  const double best = cost(estimate);
  for (int i = 0; i < 200; ++i) {
    const Sim3 nearby(estimate.scale * (1.0 + 1e-3 * test::Gaussian(rng)),
                      ExpSO3(GaussianVector(rng, 1e-3)) * estimate.rotation,
                      estimate.translation + GaussianVector(rng, 1e-3));
    EXPECT_GE(cost(nearby), best);
  }
}

TEST(AlignSim3, TooFewCollinearOrUnequalPointsAreRefusedAndOutputIsKept) {
  const Sim3 before(2.0, Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3));
  Sim3 estimate = before;
  const std::vector<Eigen::Vector3d> two = {{0, 0, 0}, {1, 0, 0}};
  const std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {-3, -3, -3}};
  const std::vector<Eigen::Vector3d> plane = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  const std::vector<Eigen::Vector3d> one_place(4, Eigen::Vector3d(1, 1, 1));
  EXPECT_FALSE(AlignSim3(two, two, &estimate));
  EXPECT_FALSE(AlignSim3(line, line, &estimate));
  EXPECT_FALSE(AlignSim3(plane, line, &estimate));
  EXPECT_FALSE(AlignSim3(line, plane, &estimate));
  EXPECT_FALSE(AlignSim3(one_place, plane, &estimate));
  EXPECT_FALSE(AlignSim3(plane, two, &estimate));
  EXPECT_FALSE(AlignSim3({}, {}, &estimate));
  EXPECT_EQ(estimate.scale, before.scale);
  EXPECT_EQ(estimate.translation, before.translation);
}

}  // namespace
}  // namespace haustra
