// How far away the wall is along a ray, from the map points around it. Two views a short way apart measure the depth of
// a point poorly, and whoever keeps only the points whose depth comes out well keeps those whose noise has widened the
// angle between the rays: they lie too near. Weighed against the wall around it, a point needs no such choice.
// thread-bound(mapping).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "engine/atlas/atlas.h"

namespace haustra {

// Of an inverse depth, 1 / map units.
struct InverseDepth {
  double value = 0.0;
  double sigma = 0.0;  // > 0
};

// Inverse depth along `ray_a` at which it passes nearest to `ray_b`: unit vectors in the frame of camera a, `b_in_a`
// the centre of camera b there. `sigma_rad`: of the angle between the rays. Negative where the rays meet behind a.
// False when the baseline lies along the ray and nothing is measured.
bool MeasureInverseDepth(const Eigen::Vector3d& ray_a, const Eigen::Vector3d& ray_b, const Eigen::Vector3d& b_in_a,
                         double sigma_rad, InverseDepth* out);

// Mean of two independent normal distributions, weighted with their information.
InverseDepth Combine(const InverseDepth& a, const InverseDepth& b);

class SurfaceDepth {
 public:
  // Takes the points that the keyframe sees now.
  void Load(const Keyframe& keyframe, const Atlas& atlas);
  // Median of the nearest points' depths. False: the keyframe sees too few.
  bool At(const Eigen::Vector2d& pixel, double* depth);

 private:
  struct Sample {
    Eigen::Vector2d pixel;
    double depth = 0.0;
  };
  struct Neighbour {
    double distance2 = 0.0;
    double depth = 0.0;
  };
  std::vector<Sample> samples_;
  std::vector<Neighbour> neighbours_;
};

}  // namespace haustra
