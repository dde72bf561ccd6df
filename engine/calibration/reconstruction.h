// Views and points of one window, reconstructed with intrinsics that are held: two views by TwoViewRansac, the others
// by AbsolutePoseRansac, points by triangulation. What joint_adjustment.h starts from. reentrant. Allocates.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "engine/calibration/feature_window.h"
#include "engine/calibration/intrinsics.h"
#include "engine/geometry/se3.h"

namespace haustra::calibration {

struct PointObservation {
  std::int32_t view = 0;
  std::int32_t point = 0;
  Eigen::Vector2d pixel;
  double sigma_px = 1.0;  // relative: of a feature of usual scale 1
};

// Living tissue moves while the scope does: each view sees the points through a small strain of its own, five numbers
// over the symmetric matrices without trace (what a strain has beyond them is motion of the camera).
using StrainVector = Eigen::Matrix<double, 5, 1>;
Eigen::Matrix3d StrainMatrix(const StrainVector& strain);

struct Reconstruction {
  std::vector<SE3> cam_from_world;             // of the views that were placed; the first is held
  std::vector<StrainVector> strains;           // one a view, zero in the first: the view sees (1 + strain) * point
  std::vector<Eigen::Vector3d> points;         // world frame, unit: the window's own
  std::vector<PointObservation> observations;  // in order of their points, at least three a point
};

struct ReconstructionOptions {
  double tolerance_px = 3.0;  // of a feature of scale 1: a match farther off is an outlier
  int min_views = 4;          // placed, else there is no reconstruction
  int min_points = 40;
};

// False when no two views with enough parallax agree on a motion, or too few views and points follow from them.
bool Reconstruct(const FeatureWindow& window, const Intrinsics& intrinsics, const ReconstructionOptions& options,
                 std::uint64_t seed, Reconstruction* out);

// Where a view has a point, in its camera.
inline Eigen::Vector3d PointInCamera(const Reconstruction& reconstruction, const PointObservation& o) {
  const Eigen::Vector3d& point = reconstruction.points[o.point];
  return reconstruction.cam_from_world[o.view] * (point + StrainMatrix(reconstruction.strains[o.view]) * point);
}

// Takes out observations farther than `tolerance_px` (times their sigma), then points seen fewer than three times.
// Returns how many observations are left.
int DropOutliers(const Intrinsics& intrinsics, double tolerance_px, Reconstruction* reconstruction);

}  // namespace haustra::calibration
