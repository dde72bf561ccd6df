#include "engine/optim/benchmarks/synthetic_bundle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/rng.h"

namespace haustra {
namespace {

constexpr double kTubeRadius = 1.0;
constexpr double kStep = 0.08;     // between cameras, tube radii
constexpr double kMinDepth = 0.3;  // of points in front of the camera that first sees them
constexpr double kMaxDepth = 3.0;
constexpr double kMinSigmaPx = 1.0;
constexpr double kMaxSigmaPx = 4.0;

double Gaussian(Rng* rng) {
  // Box and Muller; 1 - u keeps the logarithm finite.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - rng->Uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * rng->Uniform());
}

Eigen::Vector3d GaussianVector(Rng* rng, double sigma) {
  const double x = Gaussian(rng), y = Gaussian(rng), z = Gaussian(rng);
  return sigma * Eigen::Vector3d(x, y, z);
}

SE3 CameraPose(int idx) {
  const double s = kStep * idx;
  const Eigen::Vector3d centre(0.15 * std::sin(1.7 * s), 0.12 * std::cos(2.3 * s), s);
  const Eigen::Quaterniond world_from_cam = ExpSO3({0.1 * std::sin(1.1 * s), 0.12 * std::sin(1.9 * s), 0.2 * s});
  return SE3(world_from_cam, centre).Inverse();
}

}  // namespace

CameraModel SyntheticEndoscope() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kKannalaBrandt;
  calibration.width_px = 720;
  calibration.height_px = 540;
  calibration.fx = 340.0;
  calibration.fy = 341.0;
  calibration.cx = 362.0;
  calibration.cy = 268.0;
  calibration.coefficients = {-0.02, 0.004, -0.001, 0.0001};
  return CameraModel::Create(calibration).value();
}

SyntheticBundle MakeSyntheticBundle(const SyntheticBundleOptions& options) {
  SyntheticBundle bundle;
  bundle.camera = SyntheticEndoscope();
  Rng rng(options.seed);
  BundleProblem& truth = bundle.truth;
  for (int i = 0; i < options.num_poses; ++i) {
    truth.poses.push_back({.cam_from_world = CameraPose(i), .is_fixed = i < options.num_fixed_poses});
  }
  const double length = kStep * (options.num_poses - 1);
  while (static_cast<int>(truth.points.size()) < options.num_points) {
    const double angle = rng.Uniform(0.0, 2.0 * std::numbers::pi);
    const double radius = kTubeRadius * rng.Uniform(0.85, 1.0);  // folds
    const Eigen::Vector3d position(radius * std::cos(angle), radius * std::sin(angle),
                                   rng.Uniform(kMinDepth, length + kMaxDepth));
    // Track lengths are spread evenly between 2 and twice the mean less 2.
    const int longest = std::max(2, static_cast<int>(2.0 * options.mean_track_length) - 2);
    const int wanted = std::min(options.num_poses, 2 + static_cast<int>(rng.UniformInt(longest - 1)));
    const int first = static_cast<int>(rng.UniformInt(options.num_poses - wanted + 1));
    std::vector<BundleObservation> track;
    for (int pose_idx = first; pose_idx < first + wanted; ++pose_idx) {
      const Eigen::Vector3d point_in_cam = truth.poses[pose_idx].cam_from_world * position;
      Eigen::Vector2d pixel;
      if (point_in_cam.z() < 0.5 * kMinDepth || point_in_cam.z() > kMaxDepth ||
          !bundle.camera.Project(point_in_cam, &pixel) || !bundle.camera.IsInImage(pixel, 4.0)) {
        continue;
      }
      track.push_back({.pose_idx = pose_idx,
                       .point_idx = static_cast<std::int32_t>(truth.points.size()),
                       .pixel = pixel,
                       .sigma_px = rng.Uniform(kMinSigmaPx, kMaxSigmaPx)});
    }
    if (static_cast<int>(track.size()) < wanted) continue;
    truth.points.push_back({.position = position});
    truth.observations.insert(truth.observations.end(), track.begin(), track.end());
  }
  // The order in which a mapper hands them over: by keyframe.
  std::stable_sort(truth.observations.begin(), truth.observations.end(),
                   [](const BundleObservation& a, const BundleObservation& b) { return a.pose_idx < b.pose_idx; });

  for (BundleObservation& observation : truth.observations) {
    const double sigma = options.pixel_noise_sigmas * observation.sigma_px;
    const double dx = Gaussian(&rng), dy = Gaussian(&rng);
    observation.pixel += sigma * Eigen::Vector2d(dx, dy);
    if (rng.Uniform() < options.outlier_share) {
      const double angle = rng.Uniform(0.0, 2.0 * std::numbers::pi);
      observation.pixel += rng.Uniform(20.0, 80.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      observation.is_outlier = true;
    }
  }
  bundle.start = truth;
  for (BundlePose& pose : bundle.start.poses) {
    if (pose.is_fixed) continue;
    Vector6d delta;
    delta.head<3>() = GaussianVector(&rng, options.pose_noise_rad * kTubeRadius);
    delta.tail<3>() = GaussianVector(&rng, options.pose_noise_rad);
    pose.cam_from_world = SE3::Exp(delta) * pose.cam_from_world;
  }
  for (BundlePoint& point : bundle.start.points) {
    point.position += GaussianVector(&rng, options.point_noise_radii * kTubeRadius);
  }
  for (BundleObservation& observation : bundle.start.observations) observation.is_outlier = false;
  return bundle;
}

}  // namespace haustra
