#include "engine/io/fisheye_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace haustra {
namespace {

constexpr int kNumParameters = 8;  // fx fy cx cy k1 k2 k3 k4
constexpr int kGridColumns = 40;
constexpr int kGridRows = 30;
constexpr int kMinSamples = 50;
constexpr int kMaxIterations = 100;

using Parameters = Eigen::Matrix<double, kNumParameters, 1>;
using NormalMatrix = Eigen::Matrix<double, kNumParameters, kNumParameters>;

struct Sample {
  Eigen::Vector2d pixel;
  Eigen::Vector2d direction;  // unit, in the image plane: which way from the axis
  double angle_rad;           // how far from the axis
};

std::vector<Sample> SampleImage(const CameraModel& camera) {
  std::vector<Sample> samples;
  for (int row = 0; row < kGridRows; ++row) {
    for (int column = 0; column < kGridColumns; ++column) {
      const Eigen::Vector2d pixel((camera.width_px() - 1.0) * column / (kGridColumns - 1),
                                  (camera.height_px() - 1.0) * row / (kGridRows - 1));
      Eigen::Vector3d bearing;
      if (!camera.Unproject(pixel, &bearing)) continue;
      const double sine = bearing.head<2>().norm();
      const Eigen::Vector2d direction = sine > 0.0 ? Eigen::Vector2d(bearing.head<2>() / sine) : Eigen::Vector2d(1, 0);
      samples.push_back({pixel, direction, std::atan2(sine, bearing.z())});
    }
  }
  return samples;
}

// Sum of squared pixel distances; the normal equations too when they are asked for.
double Evaluate(const std::vector<Sample>& samples, const Parameters& p, NormalMatrix* hessian, Parameters* gradient) {
  double cost = 0.0;
  if (hessian != nullptr) {
    hessian->setZero();
    gradient->setZero();
  }
  for (const Sample& sample : samples) {
    const double angle2 = sample.angle_rad * sample.angle_rad;
    std::array<double, 4> powers;  // th^3 th^5 th^7 th^9
    double power = sample.angle_rad, radius = sample.angle_rad;
    for (int i = 0; i < 4; ++i) {
      power *= angle2;
      powers[i] = power;
      radius += p[4 + i] * power;
    }
    for (int axis = 0; axis < 2; ++axis) {
      const double residual = p[axis] * radius * sample.direction[axis] + p[2 + axis] - sample.pixel[axis];
      cost += residual * residual;
      if (hessian == nullptr) continue;
      Parameters row = Parameters::Zero();
      row[axis] = radius * sample.direction[axis];
      row[2 + axis] = 1.0;
      for (int i = 0; i < 4; ++i) row[4 + i] = p[axis] * sample.direction[axis] * powers[i];
      *hessian += row * row.transpose();
      *gradient += row * residual;
    }
  }
  return cost;
}

Parameters Minimise(const std::vector<Sample>& samples, Parameters parameters) {
  NormalMatrix hessian;
  Parameters gradient;
  double cost = Evaluate(samples, parameters, &hessian, &gradient);
  double damping = 1e-4;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    NormalMatrix damped = hessian;
    damped.diagonal() *= 1.0 + damping;
    const Parameters candidate = parameters - damped.ldlt().solve(gradient);
    const double candidate_cost = Evaluate(samples, candidate, nullptr, nullptr);
    if (!(candidate_cost < cost)) {
      damping *= 10.0;
      if (damping > 1e12) break;
      continue;
    }
    const bool is_converged = cost - candidate_cost < 1e-12 * cost;
    parameters = candidate;
    cost = Evaluate(samples, parameters, &hessian, &gradient);
    damping = std::max(damping * 0.1, 1e-12);
    if (is_converged) break;
  }
  return parameters;
}

}  // namespace

Result<FisheyeFit> FitFisheye(const CameraModel& camera) {
  const std::vector<Sample> samples = SampleImage(camera);
  if (samples.size() < kMinSamples) {
    return InvalidArgument("fisheye fit: only " + std::to_string(samples.size()) + " of " +
                           std::to_string(kGridColumns * kGridRows) + " image points have a ray");
  }
  Parameters start;
  start << camera.focal_px(), camera.focal_px(), camera.calibration().cx, camera.calibration().cy, 0, 0, 0, 0;
  const Parameters best = Minimise(samples, start);

  FisheyeFit fit;
  fit.calibration = camera.calibration();
  fit.calibration.kind = CameraModelKind::kKannalaBrandt;
  fit.calibration.fx = best[0];
  fit.calibration.fy = best[1];
  fit.calibration.cx = best[2];
  fit.calibration.cy = best[3];
  fit.calibration.coefficients = {best[4], best[5], best[6], best[7]};
  if (const Result<CameraModel> check = CameraModel::Create(fit.calibration); !check.ok()) {
    return Internal("fisheye fit: " + check.status().message());
  }
  double sum = 0.0;
  for (const Sample& sample : samples) {
    const double squared = Evaluate({sample}, best, nullptr, nullptr);
    sum += squared;
    fit.max_px = std::max(fit.max_px, std::sqrt(squared));
  }
  fit.rms_px = std::sqrt(sum / static_cast<double>(samples.size()));
  return fit;
}

}  // namespace haustra
