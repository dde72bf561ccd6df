// The normal equations of one window of joint_adjustment.h. Private to engine/calibration and its tests.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "engine/calibration/intrinsics.h"
#include "engine/calibration/reconstruction.h"

namespace haustra::calibration {

struct NoiseModel {
  double noise_px = 1.0;    // of an observation of sigma 1
  double loss_width = 2.0;  // of Cauchy's loss, in units of the noise
  double strain_sigma = 0.01;
};

// thread-bound(its owner).
class WindowSystem {
 public:
  // Residuals and derivatives at this state. Returns the robust cost.
  double Linearise(const Intrinsics& intrinsics, const Reconstruction& reconstruction, const NoiseModel& noise);
  // Eliminates points and views, with `damping` times the diagonal added to theirs. False: not positive definite.
  bool Reduce(double damping, IntrinsicMatrix* information, IntrinsicVector* gradient);
  // The state after the step that belongs to this step of the intrinsics. After Reduce.
  void Step(const IntrinsicVector& intrinsic_step, const Reconstruction& from, Reconstruction* to) const;
  // See AdjustedWindow. After Reduce without damping.
  double MeanSquareStrain(const Reconstruction& reconstruction) const;

  static double Cost(const Intrinsics& intrinsics, const Reconstruction& reconstruction, const NoiseModel& noise);

 private:
  static constexpr int kViewSize = 11;  // SE3 tangent, strain
  using ViewMatrix = Eigen::Matrix<double, kViewSize, kViewSize>;

  struct Row {  // one observation, whitened
    int view = 0, point = 0;
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, kViewSize> by_view;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, kNumIntrinsics> by_intrinsics;
  };

  int num_views_ = 0;
  double strain_weight_ = 0.0;
  std::vector<Row> rows_;
  std::vector<Eigen::Vector3d> translations_;  // cam_from_world, for the gauge of the scale
  std::vector<StrainVector> strains_;
  std::vector<Eigen::Matrix3d> point_inverse_;
  std::vector<Eigen::Vector3d> point_gradient_;
  Eigen::LLT<Eigen::MatrixXd> view_factor_;
  Eigen::MatrixXd view_by_intrinsics_;  // reduced
  Eigen::VectorXd view_gradient_;       // reduced
};

// Moves each point where its observations want it, the views held: points far away, whose steps are not linear, would
// otherwise hold back the adjustment of everything.
void SettlePoints(const Intrinsics& intrinsics, const NoiseModel& noise, Reconstruction* reconstruction);

}  // namespace haustra::calibration
