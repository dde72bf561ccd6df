// The centre line of a lumen, and the coordinates of points about it: length along it, angle around it, distance from
// it. Map frame, map units. Its frame does not twist about the tangent (rotation-minimising, by the double reflection
// of Wang, Juttler, Zheng, Liu 2008). Allocates at construction; after that immutable, reentrant, rt-safe.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace haustra {

struct LumenFrame {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitZ();  // (normal, binormal, tangent) is right-handed, unit
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  Eigen::Vector3d binormal = Eigen::Vector3d::UnitY();
};

struct WallCoordinates {
  double length_mu = 0.0;
  double angle_rad = 0.0;  // (-pi, pi], from the normal towards the binormal
  double radius_mu = 0.0;
};

class LumenLine {
 public:
  LumenLine() = default;
  // Through points in order, in steps of about step_mu > 0, a whole number of them. At least two points, not all in one
  // place.
  LumenLine(std::span<const Eigen::Vector3d> points, double step_mu);

  double length_mu() const { return step_mu_ * (num_stations() - 1); }
  double step_mu() const { return step_mu_; }
  int num_stations() const { return static_cast<int>(stations_.size()); }
  const LumenFrame& station(int i) const { return stations_[i]; }  // at i * step_mu()

  // Between stations linear, beyond the ends straight on.
  LumenFrame At(double length_mu) const;
  // Of the place on the line nearest to the point, found from a guess that is not far off. Near a bend a point may have
  // several such places; the guess decides.
  WallCoordinates From(const Eigen::Vector3d& point_in_map, double guess_mu) const;
  // The same without a guess. O(stations).
  WallCoordinates Of(const Eigen::Vector3d& point_in_map) const;

 private:
  double step_mu_ = 1.0;
  std::vector<LumenFrame> stations_;
};

}  // namespace haustra
