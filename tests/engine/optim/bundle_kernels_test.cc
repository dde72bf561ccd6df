// The vector passes of bundle adjustment against the scalar camera model and against normal equations formed and
// reduced as a whole, for every instruction set that this machine has.
#include "engine/optim/bundle_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/geometry/rng.h"
#include "engine/geometry/se3.h"
#include "engine/optim/bundle_support.h"
#include "tests/engine/optim/vector_cases.h"

namespace haustra::optim {
namespace {

using Numbers = LinearisedObservations;

// Observations in the order that the kernels want, with arrays of just the promised length.
class Window {
 public:
  struct Observation {
    int point, pose, free_pose;
    Eigen::Vector2d pixel;
    double sigma = 1.0;
  };

  Window(const CameraModel& camera, double gate, const std::vector<SE3>& poses,
         const std::vector<Eigen::Vector4d>& points, const std::vector<Observation>& observations)
      : num_(static_cast<int>(observations.size())), num_points_(static_cast<int>(points.size())) {
    const std::size_t num_rows = observations.size() + kMaxVectorLanes;
    for (auto* numbers : {&u_, &v_, &inverse_sigma_}) numbers->resize(num_rows);
    for (auto* indices : {&pose_, &free_pose_, &point_}) indices->resize(num_rows);
    begin_.resize(points.size() + 1);
    for (int o = 0; o < num_; ++o) {
      const Observation& observation = observations[o];
      u_[o] = observation.pixel.x();
      v_[o] = observation.pixel.y();
      inverse_sigma_[o] = 1.0 / observation.sigma;
      pose_[o] = observation.pose;
      free_pose_[o] = observation.free_pose;
      point_[o] = observation.point;
      begin_[observation.point + 1] = o + 1;
    }
    for (std::size_t j = 1; j < begin_.size(); ++j) begin_[j] = std::max(begin_[j], begin_[j - 1]);
    for (const SE3& pose : poses) {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> r = pose.matrix3();
      for (int i = 0; i < 3; ++i) {
        pose_rows_.insert(pose_rows_.end(), {r(i, 0), r(i, 1), r(i, 2), pose.translation[i]});
      }
    }
    for (const Eigen::Vector4d& point : points) points_.insert(points_.end(), point.data(), point.data() + 4);
    view_ = {.camera = camera.projection_constants(),
             .huber_threshold = std::sqrt(gate),
             .unseen_chi2 = kUnseenThresholds * kUnseenThresholds * gate,
             .u = u_.data(),
             .v = v_.data(),
             .inverse_sigma = inverse_sigma_.data(),
             .pose = pose_.data(),
             .free_pose = free_pose_.data(),
             .point = point_.data(),
             .begin = begin_.data(),
             .poses = pose_rows_.data(),
             .points = points_.data()};
    chi2_.resize(num_rows);
    stride_ = num_ + kMaxVectorLanes;
    numbers_.resize(static_cast<std::size_t>(stride_) * Numbers::kNumbers);
  }
  Window(const Window&) = delete;

  int num() const { return num_; }
  int num_points() const { return num_points_; }
  const BundleView& view() const { return view_; }
  double Linearise(const BundleKernels& kernels, int begin, int end) {
    const LinearisedObservations out = linearised();
    return kernels.Linearise(view_, begin, end, chi2_.data(), &out);
  }
  double Cost(const BundleKernels& kernels) { return kernels.Linearise(view_, 0, num_, chi2_.data(), nullptr); }
  LinearisedObservations linearised() { return {.numbers = numbers_.data(), .stride = stride_, .first = 0}; }
  double chi2(int o) const { return chi2_[o]; }
  double number(int k, int o) const { return numbers_[static_cast<std::size_t>(k) * stride_ + o]; }

 private:
  int num_, num_points_, stride_;
  std::vector<double> u_, v_, inverse_sigma_, pose_rows_, points_, chi2_, numbers_;
  std::vector<std::int32_t> pose_, free_pose_, point_, begin_;
  BundleView view_;
};

// One camera at the origin that looks at points, everything at pixel (0, 0), without robust weights.
std::vector<Window::Observation> OneEach(std::size_t num) {
  std::vector<Window::Observation> observations;
  for (int j = 0; j < static_cast<int>(num); ++j) {
    observations.push_back({.point = j, .pose = 0, .free_pose = 0, .pixel = Eigen::Vector2d::Zero()});
  }
  return observations;
}
constexpr double kWideGate = 1e12;

std::vector<Eigen::Vector4d> PointsAllAround(int num, std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Eigen::Vector4d> points;
  while (static_cast<int>(points.size()) < num) {
    const double x = rng.Uniform(-1.0, 1.0), y = rng.Uniform(-1.0, 1.0), z = rng.Uniform(-1.0, 1.0);
    const double scale = std::exp(rng.Uniform(-3.0, 3.0));
    points.push_back({scale * x, scale * y, scale * z, 1.0});
  }
  return points;
}

SE3 SomePose(Rng* rng, double size) {
  Vector6d delta;
  for (double& number : delta) number = rng->Uniform(-size, size);
  return SE3::Exp(delta);
}

class BundleKernelsOf : public ::testing::TestWithParam<test::VectorCase> {
 protected:
  const BundleKernels& kernels_ = BundleKernelsFor(GetParam().level);
  const CameraModel camera_ = test::CameraOfKind(GetParam().kind);

  // Every observation of `window`, which is that of OneEach, against CameraModel. Returns how many are seen.
  int ExpectAsCameraModel(const std::vector<Eigen::Vector4d>& points) {
    Window window(camera_, kWideGate, {SE3()}, points, OneEach(points.size()));
    window.Linearise(kernels_, 0, window.num());
    int num_seen = 0;
    for (int o = 0; o < window.num(); ++o) {
      SCOPED_TRACE(::testing::Message() << "point " << points[o].transpose());
      Eigen::Vector2d pixel;
      CameraModel::ProjectionJacobian jacobian;
      if (!camera_.Project(points[o].head<3>(), &pixel, &jacobian)) {
        EXPECT_EQ(window.chi2(o), window.view().unseen_chi2);
        for (int k = 0; k < Numbers::kNumbers; ++k) EXPECT_EQ(window.number(k, o), 0.0);
        continue;
      }
      ++num_seen;
      EXPECT_NEAR(window.chi2(o), pixel.squaredNorm(), 1e-12 * pixel.squaredNorm());
      for (int r = 0; r < 2; ++r) {
        EXPECT_NEAR(window.number(Numbers::kResidual + r, o), pixel[r], 1e-13 * pixel.norm());
        for (int i = 0; i < 3; ++i) {
          EXPECT_NEAR(window.number(Numbers::kByPose + 6 * r + i, o), jacobian(r, i), 1e-13 * jacobian.norm());
          EXPECT_NEAR(window.number(Numbers::kByPoint + 3 * r + i, o), jacobian(r, i), 1e-13 * jacobian.norm());
        }
      }
    }
    return num_seen;
  }
};
INSTANTIATE_TEST_SUITE_P(All, BundleKernelsOf, ::testing::ValuesIn(test::SupportedVectorCases()), test::VectorCaseName);

TEST_P(BundleKernelsOf, ProjectAsTheCameraModelDoes) {
  const int num_seen = ExpectAsCameraModel(PointsAllAround(2001, 1));
  EXPECT_GT(num_seen, 200);
  EXPECT_LT(num_seen, 1800);
}

TEST_P(BundleKernelsOf, ProjectAsTheCameraModelDoesOnTheAxisAndAtTheEdge) {
  std::vector<Eigen::Vector4d> points;
  for (const double z : {2.0, -2.0, 0.0}) {
    for (const double x : {0.0, 1e-30, 1e-13, -3e-9, 3e-8, -1e-5, 1e-3}) {
      points.push_back({x, 0.0, z, 1.0});
      points.push_back({0.0, -x, z, 1.0});
      points.push_back({x, 0.5 * x, z, 1.0});
    }
  }
  for (const double angle : {0.7853981, 0.7853982, 1.5707963, 1.5707964, 2.3561944, 2.3561945, 3.1415926}) {
    points.push_back({std::sin(angle), 0.0, std::cos(angle), 1.0});
  }
  for (const double relative : {1.0 - 1e-9, 1.0 + 1e-9}) {
    const double angle = relative * camera_.max_half_angle_rad();
    points.push_back({0.6 * std::sin(angle), -0.8 * std::sin(angle), std::cos(angle), 1.0});
  }
  EXPECT_GT(ExpectAsCameraModel(points), 10);
}

TEST_P(BundleKernelsOf, JacobiansAreThoseOfFiniteDifferences) {
  Rng rng(3);
  const SE3 pose = SomePose(&rng, 0.4);
  constexpr double kStep = 1e-6;
  for (const Eigen::Vector4d& point : PointsAllAround(40, 7)) {
    if ((pose * point.head<3>()).z() < 0.3 * point.head<3>().norm()) continue;
    const auto window_at = [&](const SE3& at, const Eigen::Vector4d& position) {
      auto window = std::make_unique<Window>(camera_, kWideGate, std::vector{at}, std::vector{position}, OneEach(1));
      window->Linearise(kernels_, 0, 1);
      return window;
    };
    const auto window = window_at(pose, point);
    if (window->chi2(0) == window->view().unseen_chi2) continue;
    const double step = kStep * point.head<3>().norm();
    for (int i = 0; i < 6; ++i) {
      Vector6d delta = Vector6d::Zero();
      delta[i] = i < 3 ? step : kStep;
      const auto ahead = window_at(SE3::Exp(delta) * pose, point);
      const auto behind = window_at(SE3::Exp(-delta) * pose, point);
      for (int r = 0; r < 2; ++r) {
        const double expected = (ahead->number(r, 0) - behind->number(r, 0)) / (2.0 * delta[i]);
        EXPECT_NEAR(window->number(Numbers::kByPose + 6 * r + i, 0), expected, 1e-5 * (1.0 + std::abs(expected)));
      }
    }
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector4d delta = step * Eigen::Vector4d::Unit(i);
      const auto ahead = window_at(pose, point + delta);
      const auto behind = window_at(pose, point - delta);
      for (int r = 0; r < 2; ++r) {
        const double expected = (ahead->number(r, 0) - behind->number(r, 0)) / (2.0 * step);
        EXPECT_NEAR(window->number(Numbers::kByPoint + 3 * r + i, 0), expected, 1e-5 * (1.0 + std::abs(expected)));
      }
    }
  }
}

TEST_P(BundleKernelsOf, WhereAStretchBeginsAndEndsDoesNotShow) {
  const std::vector<Eigen::Vector4d> points = PointsAllAround(11, 5);
  const auto observations = OneEach(points.size());
  constexpr double kGate = 250.0 * 250.0;  // splits them into inliers and outliers
  Window whole(camera_, kGate, {SE3()}, points, observations);
  const double cost = whole.Linearise(kernels_, 0, whole.num());
  EXPECT_NEAR(whole.Cost(kernels_), cost, 1e-12 * cost);
  double expected_cost = 0.0;
  for (int o = 0; o < whole.num(); ++o) expected_cost += 0.5 * HuberLoss(whole.chi2(o), std::sqrt(kGate));
  EXPECT_NEAR(cost, expected_cost, 1e-12 * cost);
  for (int split = 0; split <= whole.num(); ++split) {
    Window halves(camera_, kGate, {SE3()}, points, observations);
    const double first = halves.Linearise(kernels_, 0, split);
    const double second = halves.Linearise(kernels_, split, halves.num());
    EXPECT_NEAR(first + second, cost, 1e-12 * cost);
    for (int o = 0; o < halves.num(); ++o) {
      EXPECT_EQ(halves.chi2(o), whole.chi2(o));
      for (int k = 0; k < Numbers::kNumbers; ++k) EXPECT_EQ(halves.number(k, o), whole.number(k, o));
    }
  }
}

TEST_P(BundleKernelsOf, ReducedSystemIsTheSchurComplementOfTheNormalEquations) {
  // Five poses, the second fixed; points with no to seven observations (two by one pose), one that stays, one that
  // three cameras have behind them, one whose observations are at odds.
  constexpr int kPoses = 5, kFree = 4, kPoints = 9, kStays = 4, kBehind = 5, kAtOdds = 6, kTwice = 7;
  constexpr double kGate = 5.991, kLambda = 1e-3;
  Rng rng(11);
  std::vector<SE3> poses;
  for (int i = 0; i < kPoses; ++i) poses.push_back(SomePose(&rng, 0.3));
  std::vector<Eigen::Vector4d> points;
  std::vector<Window::Observation> observations;
  for (int j = 0; j < kPoints; ++j) {
    const double depth = j == kBehind ? -2.0 : 2.0;
    points.push_back({rng.Uniform(-0.6, 0.6), rng.Uniform(-0.6, 0.6), depth, j == kStays ? 0.0 : 1.0});
    // The fixed pose first: it has no number among the free ones.
    std::vector<std::pair<int, int>> views = {{1, -1}, {0, 0}, {2, 1}, {3, 2}, {4, 3}};
    if (j < kStays) views.erase(views.begin() + j, views.end());
    if (j == kTwice) views.insert(views.begin() + 2, 2, {2, 1});
    for (const auto& [pose, free_pose] : views) {
      Eigen::Vector2d pixel(300.0, 300.0);
      camera_.Project(poses[pose] * points[j].head<3>(), &pixel);
      const double off = j == kAtOdds ? 30.0 : 1.0;
      pixel += Eigen::Vector2d(rng.Uniform(-off, off), rng.Uniform(-off, off));
      observations.push_back({j, pose, free_pose, pixel, rng.Uniform(0.7, 3.0)});
    }
  }

  Window window(camera_, kGate, poses, points, observations);
  window.Linearise(kernels_, 0, window.num());
  std::vector<double> blocks(36 * kFree * (kFree + 1) / 2), pose_sums(12 * kFree);
  std::vector<double> y(18 * (observations.size() + kMaxVectorLanes));
  std::vector<EliminatedPoint> eliminated(kPoints);
  kernels_.Eliminate(
      window.view(), 0, kPoints, kLambda, window.linearised(),
      {.blocks = blocks.data(), .pose_sums = pose_sums.data(), .points = eliminated.data(), .y = y.data()});

  // All unknowns at once, by the scalar camera model.
  constexpr int kPoseSize = 6 * kFree, kSize = kPoseSize + 3 * kPoints;
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kSize, kSize);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(kSize);
  int num_unseen = 0, num_outliers = 0;
  for (const Window::Observation& observation : observations) {
    const Eigen::Vector3d p = poses[observation.pose] * points[observation.point].head<3>();
    Eigen::Vector2d pixel;
    CameraModel::ProjectionJacobian d_cam;
    if (!camera_.Project(p, &pixel, &d_cam)) {
      ++num_unseen;
      continue;
    }
    const Eigen::Vector2d residual = (pixel - observation.pixel) / observation.sigma;
    const double chi2 = residual.squaredNorm();
    num_outliers += chi2 > kGate;
    const double weight = chi2 <= kGate ? 1.0 : std::sqrt(kGate / chi2);
    d_cam /= observation.sigma;
    Eigen::MatrixXd row = Eigen::MatrixXd::Zero(2, kSize);
    if (observation.free_pose >= 0) {
      row.middleCols<3>(6 * observation.free_pose) = d_cam;
      row.middleCols<3>(6 * observation.free_pose + 3) = -d_cam * Skew(p);
    }
    if (points[observation.point][3] != 0.0) {
      row.middleCols<3>(kPoseSize + 3 * observation.point) = d_cam * poses[observation.pose].matrix3();
    }
    normal += weight * row.transpose() * row;
    gradient += weight * row.transpose() * residual;
  }
  EXPECT_GE(num_unseen, 5);
  EXPECT_GE(num_outliers, 3);

  const Eigen::VectorXd pose_diagonal = normal.diagonal().head<kPoseSize>();
  Eigen::MatrixXd reduced = normal.topLeftCorner<kPoseSize, kPoseSize>();
  Eigen::VectorXd reduced_gradient = gradient.head<kPoseSize>();
  for (int j = 0; j < kPoints; ++j) {
    const int at = kPoseSize + 3 * j;
    Eigen::Matrix3d v = normal.block<3, 3>(at, at);
    if (!(v.diagonal().maxCoeff() > 0.0)) {
      EXPECT_EQ(eliminated[j].inverse_l00, 0.0) << j;
      continue;
    }
    const Eigen::Vector3d diagonal = v.diagonal();
    v.diagonal() += kLambda * diagonal.cwiseMax(kDiagonalFloor * diagonal.maxCoeff());
    const Eigen::MatrixXd w = normal.block<kPoseSize, 3>(0, at);
    reduced -= w * v.inverse() * w.transpose();
    reduced_gradient -= w * v.inverse() * gradient.segment<3>(at);
  }
  const double scale = normal.topLeftCorner<kPoseSize, kPoseSize>().norm();
  for (int row = 0; row < kFree; ++row) {
    for (int column = 0; column <= row; ++column) {
      const Eigen::Map<const Matrix6d> block(blocks.data() + 36 * (row * (row + 1) / 2 + column));
      const Matrix6d expected = reduced.block<6, 6>(6 * row, 6 * column);
      EXPECT_LT((block - expected).norm(), 1e-9 * scale) << row << " " << column;
    }
    const Eigen::Map<const Eigen::Vector<double, 12>> sums(pose_sums.data() + 12 * row);
    EXPECT_LT((sums.head<6>() - reduced_gradient.segment<6>(6 * row)).norm(), 1e-9 * gradient.norm());
    EXPECT_LT((sums.tail<6>() - pose_diagonal.segment<6>(6 * row)).norm(), 1e-12 * scale);
  }
}

}  // namespace
}  // namespace haustra::optim
