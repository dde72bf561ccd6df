#include "engine/calibration/window_system.h"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <optional>
#include <span>

namespace haustra::calibration {
namespace {

// A point that the camera cannot see counts as an observation so many noises off, and pulls at nothing.
constexpr double kUnseen = 30.0;
// Added to the diagonal beside the damping, so that a point at infinity does not make the system singular.
constexpr double kMinDiagonal = 1e-9;
constexpr int kSettleSteps = 3;

double LossOf(double chi2, double loss_width) {
  const double c2 = loss_width * loss_width;
  return 0.5 * c2 * std::log1p(chi2 / c2);
}

// The views of a window as they are needed for each observation.
struct ViewTransform {
  Eigen::Matrix3d rotation;           // cam_from_world
  Eigen::Matrix3d strained_rotation;  // times one plus the strain
  Eigen::Vector3d translation;
};

std::vector<ViewTransform> TransformsOf(const Reconstruction& reconstruction) {
  std::vector<ViewTransform> transforms;
  for (std::size_t v = 0; v < reconstruction.cam_from_world.size(); ++v) {
    const SE3& pose = reconstruction.cam_from_world[v];
    const Eigen::Matrix3d rotation = pose.matrix3();
    transforms.push_back({rotation, rotation + rotation * StrainMatrix(reconstruction.strains[v]), pose.translation});
  }
  return transforms;
}

double LossAt(const Intrinsics& intrinsics, const ViewTransform& view, const Eigen::Vector3d& point,
              const PointObservation& o, const NoiseModel& noise) {
  Eigen::Vector2d pixel;
  if (!intrinsics.Project(view.strained_rotation * point + view.translation, &pixel, nullptr, nullptr)) {
    return LossOf(kUnseen * kUnseen, noise.loss_width);
  }
  const double sigma = noise.noise_px * o.sigma_px;
  return LossOf((pixel - o.pixel).squaredNorm() / (sigma * sigma), noise.loss_width);
}

double StrainCost(const Reconstruction& reconstruction, const NoiseModel& noise) {
  double cost = 0.0;
  for (const StrainVector& strain : reconstruction.strains) cost += strain.squaredNorm();
  return 0.5 * cost / (noise.strain_sigma * noise.strain_sigma);
}

const std::array<Eigen::Matrix3d, 5>& StrainBasis() {
  static const std::array<Eigen::Matrix3d, 5> basis = [] {
    std::array<Eigen::Matrix3d, 5> matrices;
    for (int i = 0; i < 5; ++i) matrices[static_cast<std::size_t>(i)] = StrainMatrix(StrainVector::Unit(i));
    return matrices;
  }();
  return basis;
}

}  // namespace

double WindowSystem::Cost(const Intrinsics& intrinsics, const Reconstruction& reconstruction, const NoiseModel& noise) {
  const std::vector<ViewTransform> views = TransformsOf(reconstruction);
  double cost = StrainCost(reconstruction, noise);
  for (const PointObservation& o : reconstruction.observations) {
    cost += LossAt(intrinsics, views[o.view], reconstruction.points[o.point], o, noise);
  }
  return cost;
}

double WindowSystem::Linearise(const Intrinsics& intrinsics, const Reconstruction& reconstruction,
                               const NoiseModel& noise) {
  num_views_ = static_cast<int>(reconstruction.cam_from_world.size());
  strain_weight_ = 1.0 / (noise.strain_sigma * noise.strain_sigma);
  strains_ = reconstruction.strains;
  point_inverse_.resize(reconstruction.points.size());
  point_gradient_.resize(reconstruction.points.size());
  translations_.clear();
  for (const SE3& pose : reconstruction.cam_from_world) translations_.push_back(pose.translation);
  const std::vector<ViewTransform> views = TransformsOf(reconstruction);
  rows_.clear();
  double cost = StrainCost(reconstruction, noise);
  for (const PointObservation& o : reconstruction.observations) {
    const ViewTransform& view = views[o.view];
    const Eigen::Vector3d& point = reconstruction.points[o.point];
    const Eigen::Vector3d in_cam = view.strained_rotation * point + view.translation;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_cam;
    Row row;
    if (!intrinsics.Project(in_cam, &pixel, &by_cam, &row.by_intrinsics)) {
      cost += LossOf(kUnseen * kUnseen, noise.loss_width);
      continue;
    }
    const double inverse_sigma = 1.0 / (noise.noise_px * o.sigma_px);
    const Eigen::Vector2d residual = inverse_sigma * (pixel - o.pixel);
    const double chi2 = residual.squaredNorm();
    cost += LossOf(chi2, noise.loss_width);
    const double root_weight = std::sqrt(1.0 / (1.0 + chi2 / (noise.loss_width * noise.loss_width)));
    row.view = o.view;
    row.point = o.point;
    row.residual = root_weight * residual;
    by_cam *= root_weight * inverse_sigma;
    row.by_intrinsics *= root_weight * inverse_sigma;
    row.by_view.leftCols<3>() = by_cam;
    row.by_view.middleCols<3>(3) = -by_cam * Skew(in_cam);
    const Eigen::Matrix<double, 2, 3> by_world = by_cam * view.rotation;
    for (int i = 0; i < 5; ++i) {
      row.by_view.col(6 + i) = by_world * (StrainBasis()[static_cast<std::size_t>(i)] * point);
    }
    row.by_point = by_cam * view.strained_rotation;
    rows_.push_back(row);
  }
  return cost;
}

bool WindowSystem::Reduce(double damping, IntrinsicMatrix* information, IntrinsicVector* gradient) {
  // View 0 is held: its unknowns do not appear.
  const int size = kViewSize * (num_views_ - 1);
  Eigen::MatrixXd views = Eigen::MatrixXd::Zero(size, size);  // lower triangle
  view_by_intrinsics_ = Eigen::MatrixXd::Zero(size, kNumIntrinsics);
  view_gradient_ = Eigen::VectorXd::Zero(size);
  information->setZero();
  gradient->setZero();
  for (const Row& row : rows_) {
    *information += row.by_intrinsics.transpose() * row.by_intrinsics;
    *gradient += row.by_intrinsics.transpose() * row.residual;
    if (row.view == 0) continue;
    const int at = kViewSize * (row.view - 1);
    views.block<kViewSize, kViewSize>(at, at) += row.by_view.transpose().lazyProduct(row.by_view);
    view_by_intrinsics_.middleRows<kViewSize>(at) += row.by_view.transpose() * row.by_intrinsics;
    view_gradient_.segment<kViewSize>(at) += row.by_view.transpose() * row.residual;
  }
  for (int v = 1; v < num_views_; ++v) {
    const int at = kViewSize * (v - 1) + 6;
    for (int i = 0; i < 5; ++i) views(at + i, at + i) += strain_weight_;
    view_gradient_.segment<5>(at) += strain_weight_ * strains_[v];
  }
  // The scale of the window is free: steps along the longest baseline are held.
  int far = 1;
  for (int v = 1; v < num_views_; ++v) {
    if ((translations_[v] - translations_[0]).norm() > (translations_[far] - translations_[0]).norm()) far = v;
  }
  const Eigen::Vector3d along = translations_[far] - translations_[0];
  const double hold = views.block<3, 3>(kViewSize * (far - 1), kViewSize * (far - 1)).trace();
  for (int i = 0; i < size; ++i) views(i, i) *= 1.0 + damping;
  if (along.norm() > 0.0) {
    const Eigen::Vector3d unit = along.normalized();
    views.block<3, 3>(kViewSize * (far - 1), kViewSize * (far - 1)) += hold * unit * unit.transpose();
  }
  // Points, one after the other: rows are in their order. Without lazyProduct, here and above, Eigen takes its way of
  // large matrices for blocks of 11x11, and an estimate takes twice as long.
  std::vector<Eigen::Matrix<double, kViewSize, 3>> by_view;
  for (std::size_t begin = 0; begin < rows_.size();) {
    std::size_t end = begin;
    Eigen::Matrix3d diagonal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d point_gradient = Eigen::Vector3d::Zero();
    Eigen::Matrix<double, kNumIntrinsics, 3> cross = Eigen::Matrix<double, kNumIntrinsics, 3>::Zero();
    by_view.clear();
    for (; end < rows_.size() && rows_[end].point == rows_[begin].point; ++end) {
      const Row& row = rows_[end];
      diagonal += row.by_point.transpose() * row.by_point;
      point_gradient += row.by_point.transpose() * row.residual;
      cross += row.by_intrinsics.transpose() * row.by_point;
      by_view.push_back(row.by_view.transpose() * row.by_point);
    }
    const double floor = kMinDiagonal * diagonal.trace();
    for (int i = 0; i < 3; ++i) diagonal(i, i) += damping * diagonal(i, i) + floor;
    const Eigen::Matrix3d inverse = diagonal.inverse();
    const int point = rows_[begin].point;
    point_inverse_[point] = inverse;
    point_gradient_[point] = point_gradient;
    *information -= cross * inverse * cross.transpose();
    *gradient -= cross * (inverse * point_gradient);
    for (std::size_t i = 0; i < by_view.size(); ++i) {
      const int view = rows_[begin + i].view;
      if (view == 0) continue;
      const int at = kViewSize * (view - 1);
      const Eigen::Matrix<double, kViewSize, 3> scaled = by_view[i] * inverse;
      view_gradient_.segment<kViewSize>(at) -= scaled * point_gradient;
      view_by_intrinsics_.middleRows<kViewSize>(at) -= scaled * cross.transpose();
      // Views ascend within a point.
      for (std::size_t j = 0; j <= i; ++j) {
        const int other = rows_[begin + j].view;
        if (other == 0) continue;
        views.block<kViewSize, kViewSize>(at, kViewSize * (other - 1)) -= scaled.lazyProduct(by_view[j].transpose());
      }
    }
    begin = end;
  }
  view_factor_.compute(views);
  if (view_factor_.info() != Eigen::Success) return false;
  const Eigen::MatrixXd solved = view_factor_.solve(view_by_intrinsics_);
  *information -= view_by_intrinsics_.transpose() * solved;
  *gradient -= solved.transpose() * view_gradient_;
  return information->allFinite() && gradient->allFinite();
}

void WindowSystem::Step(const IntrinsicVector& intrinsic_step, const Reconstruction& from, Reconstruction* to) const {
  const Eigen::VectorXd view_step = view_factor_.solve(-view_gradient_ - view_by_intrinsics_ * intrinsic_step);
  *to = from;
  for (int v = 1; v < num_views_; ++v) {
    const int at = kViewSize * (v - 1);
    to->cam_from_world[v] = SE3::Exp(view_step.segment<6>(at)) * from.cam_from_world[v];
    to->strains[v] += view_step.segment<5>(at + 6);
  }
  for (std::size_t begin = 0; begin < rows_.size();) {
    const int point = rows_[begin].point;
    Eigen::Vector3d right = -point_gradient_[point];
    std::size_t end = begin;
    for (; end < rows_.size() && rows_[end].point == point; ++end) {
      const Row& row = rows_[end];
      Eigen::Vector2d change = row.by_intrinsics * intrinsic_step;
      if (row.view > 0) change += row.by_view * view_step.segment<kViewSize>(kViewSize * (row.view - 1));
      right -= row.by_point.transpose() * change;
    }
    to->points[point] += point_inverse_[point] * right;
    begin = end;
  }
}

double WindowSystem::MeanSquareStrain(const Reconstruction& reconstruction) const {
  const int size = kViewSize * (num_views_ - 1);
  const Eigen::MatrixXd covariance = view_factor_.solve(Eigen::MatrixXd::Identity(size, size));
  double sum = 0.0;
  for (int v = 1; v < num_views_; ++v) {
    sum += reconstruction.strains[v].squaredNorm() + covariance.diagonal().segment<5>(kViewSize * (v - 1) + 6).sum();
  }
  return sum / (5.0 * (num_views_ - 1));
}

void SettlePoints(const Intrinsics& intrinsics, const NoiseModel& noise, Reconstruction* reconstruction) {
  const std::vector<ViewTransform> views = TransformsOf(*reconstruction);
  const std::vector<PointObservation>& all = reconstruction->observations;
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin;
    while (end < all.size() && all[end].point == all[begin].point) ++end;
    const std::span<const PointObservation> seen(all.data() + begin, end - begin);
    Eigen::Vector3d& point = reconstruction->points[all[begin].point];
    const auto cost_at = [&](const Eigen::Vector3d& p) {
      double cost = 0.0;
      for (const PointObservation& o : seen) cost += LossAt(intrinsics, views[o.view], p, o, noise);
      return cost;
    };
    double cost = cost_at(point);
    for (int step = 0; step < kSettleSteps; ++step) {
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      for (const PointObservation& o : seen) {
        Eigen::Vector2d pixel;
        Eigen::Matrix<double, 2, 3> by_cam;
        const ViewTransform& view = views[o.view];
        if (!intrinsics.Project(view.strained_rotation * point + view.translation, &pixel, &by_cam, nullptr)) continue;
        const double inverse_sigma = 1.0 / (noise.noise_px * o.sigma_px);
        const Eigen::Vector2d residual = inverse_sigma * (pixel - o.pixel);
        const double weight = 1.0 / (1.0 + residual.squaredNorm() / (noise.loss_width * noise.loss_width));
        const Eigen::Matrix<double, 2, 3> by_point = inverse_sigma * by_cam * view.strained_rotation;
        matrix += weight * by_point.transpose() * by_point;
        gradient += weight * by_point.transpose() * residual;
      }
      matrix.diagonal().array() += 1e-6 * matrix.trace();
      const Eigen::Vector3d candidate = point - matrix.inverse() * gradient;
      const double candidate_cost = cost_at(candidate);
      if (!(candidate_cost < cost)) break;
      const bool is_settled = cost - candidate_cost < 1e-4;
      point = candidate;
      cost = candidate_cost;
      if (is_settled) break;
    }
    begin = end;
  }
}

}  // namespace haustra::calibration
