// The vector passes of a pose fit against the scalar camera model and against normal equations from differences of it,
// for every instruction set that this machine has.
#include "engine/optim/pose_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "tests/engine/optim/vector_cases.h"

namespace haustra::optim {
namespace {

struct Sight {
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
  double sigma;
};

class PoseKernelsTest : public testing::TestWithParam<test::VectorCase> {
 protected:
  PoseKernelsTest() {
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> r = pose_.matrix3();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) camera_pose_[4 * i + j] = r(i, j);
      camera_pose_[4 * i + 3] = pose_.translation[i];
    }
  }

  // Every fifth point lies behind the camera.
  std::vector<Sight> MakeSights(int num) {
    std::vector<Sight> sights;
    for (int i = 0; i < num; ++i) {
      const double z = rng_.Uniform(2.0, 9.0) * (i % 5 == 4 ? -1.0 : 1.0);
      const Eigen::Vector3d in_camera(rng_.Uniform(-0.4, 0.4) * z, rng_.Uniform(-0.4, 0.4) * z, z);
      Eigen::Vector2d pixel(360.0, 270.0);
      camera_.Project(in_camera, &pixel);
      pixel += Eigen::Vector2d(rng_.Uniform(-6.0, 6.0), rng_.Uniform(-6.0, 6.0));
      sights.push_back({pose_.Inverse() * in_camera, pixel, rng_.Uniform(0.7, 3.0)});
    }
    return sights;
  }

  // The rows that the view borrows, without a number more than the contract asks for.
  PoseView View(const std::vector<Sight>& sights) {
    rows_ = std::make_unique<double[]>(kPoseObservationNumbers * sights.size());
    double* row = rows_.get();
    constexpr double kAnyNumber = std::numeric_limits<double>::quiet_NaN();
    for (const Sight& sight : sights) {
      for (const double number : {sight.point.x(), sight.point.y(), sight.point.z(), kAnyNumber, sight.pixel.x(),
                                  sight.pixel.y(), sight.sigma, kAnyNumber}) {
        *row++ = number;
      }
    }
    PoseView view;
    view.camera = camera_.projection_constants();
    view.observations = rows_.get();
    view.num = static_cast<int>(sights.size());
    return view;
  }

  // Infinite where the camera does not see the point.
  double Chi2(const SE3& pose, const Sight& sight) const {
    Eigen::Vector2d pixel;
    if (!camera_.Project(pose * sight.point, &pixel)) return std::numeric_limits<double>::infinity();
    return ((pixel - sight.pixel) / sight.sigma).squaredNorm();
  }

  Eigen::Vector2d Residual(const Vector6d& step, const Sight& sight) const {
    Eigen::Vector2d pixel;
    EXPECT_TRUE(camera_.Project(SE3::Exp(step) * pose_ * sight.point, &pixel));
    return (pixel - sight.pixel) / sight.sigma;
  }

  Eigen::Matrix<double, 2, 6> Jacobian(const Sight& sight) const {
    constexpr double kStep = 1e-6;
    Eigen::Matrix<double, 2, 6> jacobian;
    for (int i = 0; i < 6; ++i) {
      const Vector6d step = kStep * Vector6d::Unit(i);
      jacobian.col(i) = (Residual(step, sight) - Residual(-step, sight)) / (2.0 * kStep);
    }
    return jacobian;
  }

  // Against sums over those sights that count, each with its weight.
  void ExpectNormals(const PoseNormals& normals, const std::vector<std::pair<Sight, double>>& weighted) const {
    Matrix6d hessian = Matrix6d::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (const auto& [sight, weight] : weighted) {
      const Eigen::Matrix<double, 2, 6> jacobian = Jacobian(sight);
      hessian += weight * jacobian.transpose() * jacobian;
      gradient += weight * jacobian.transpose() * Residual(Vector6d::Zero(), sight);
    }
    const double* number = normals.numbers;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j <= i; ++j) {
        EXPECT_NEAR(*number++, hessian(i, j), 1e-6 * std::sqrt(hessian(i, i) * hessian(j, j)));
      }
    }
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(normals.numbers[PoseNormals::kGradient + i], gradient[i], 1e-6 * gradient.norm());
    }
  }

  Rng rng_{11};
  const CameraModel camera_ = test::CameraOfKind(GetParam().kind);
  const SE3 pose_ = SE3(ExpSO3({0.3, -0.2, 0.5}), {0.4, -1.1, 0.7});
  double camera_pose_[12];
  std::unique_ptr<double[]> rows_;
  const PoseKernels& kernels_ = PoseKernelsFor(GetParam().level);
};

TEST_P(PoseKernelsTest, ErrorsAreThoseOfTheCameraModel) {
  const std::vector<Sight> sights = MakeSights(23);
  const PoseView view = View(sights);
  std::vector<double> chi2(sights.size() + kMaxVectorLanes);
  for (const auto& [begin, end] : {std::pair{0, 23}, {0, 1}, {5, 12}, {22, 23}}) {
    kernels_.Errors(view, camera_pose_, begin, end, chi2.data());
    for (int i = begin; i < end; ++i) {
      const double expected = Chi2(pose_, sights[i]);
      if (std::isinf(expected)) {
        EXPECT_TRUE(std::isinf(chi2[i - begin])) << i;
      } else {
        EXPECT_NEAR(chi2[i - begin], expected, 1e-9 * (1.0 + expected)) << i;
      }
    }
  }
}

// Also numbers that fill no vector.
TEST_P(PoseKernelsTest, RobustNormalsAreTheSumOverWhatIsSeen) {
  constexpr double kScale2 = 9.0;
  for (const int num : {1, 2, 3, 4, 5, 64, 101}) {
    SCOPED_TRACE(num);
    const std::vector<Sight> sights = MakeSights(num);
    PoseView view = View(sights);
    view.robust_scale2 = kScale2;
    double cost = 0.0;
    std::vector<std::pair<Sight, double>> weighted;
    for (const Sight& sight : sights) {
      const double chi2 = Chi2(pose_, sight);
      cost += std::isinf(chi2) ? kScale2 : kScale2 * chi2 / (kScale2 + chi2);
      if (!std::isinf(chi2)) weighted.emplace_back(sight, std::pow(kScale2 / (kScale2 + chi2), 2));
    }
    PoseNormals normals;
    EXPECT_NEAR(kernels_.Linearise(view, camera_pose_, &normals), cost, 1e-9 * cost);
    ExpectNormals(normals, weighted);
  }
}

TEST_P(PoseKernelsTest, PlainNormalsAreTheSumOverWhatIsUsed) {
  const std::vector<Sight> sights = MakeSights(38);
  PoseView view = View(sights);
  auto used = std::make_unique<std::uint8_t[]>(sights.size());
  view.used = used.get();
  double cost = 0.0;
  std::vector<std::pair<Sight, double>> weighted;
  for (std::size_t i = 0; i < sights.size(); ++i) {
    used[i] = i % 5 != 4 && i % 3 != 1;
    if (used[i] == 0) continue;
    cost += Chi2(pose_, sights[i]);
    weighted.emplace_back(sights[i], 1.0);
  }
  PoseNormals normals;
  EXPECT_NEAR(kernels_.Linearise(view, camera_pose_, &normals), cost, 1e-9 * cost);
  ExpectNormals(normals, weighted);

  used[4] = 1;  // behind the camera
  EXPECT_TRUE(std::isinf(kernels_.Linearise(view, camera_pose_, &normals)));
  ExpectNormals(normals, weighted);
}

INSTANTIATE_TEST_SUITE_P(Levels, PoseKernelsTest, testing::ValuesIn(test::SupportedVectorCases()),
                         test::VectorCaseName);

}  // namespace
}  // namespace haustra::optim
