// A tube whose centre line is a straight line or an arc of a circle, with a wall that is known at every place.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "engine/coverage/wall_grid.h"

namespace haustra {

struct BentTube {
  double radius = 1.0;
  double length = 10.0;
  double bend_radius = 0.0;  // of the centre line; 0: straight
  // Of the wall, by length and angle; empty: radius everywhere.
  std::function<double(double, double)> wall = {};

  LumenFrame At(double s) const {
    LumenFrame frame;
    if (bend_radius == 0.0) {
      frame.position = {0.0, 0.0, s};
      return frame;
    }
    const double turn = s / bend_radius;
    frame.position = {bend_radius * (1.0 - std::cos(turn)), 0.0, bend_radius * std::sin(turn)};
    frame.tangent = {std::sin(turn), 0.0, std::cos(turn)};
    frame.normal = {std::cos(turn), 0.0, -std::sin(turn)};
    frame.binormal = {0.0, 1.0, 0.0};
    return frame;
  }
  Eigen::Vector3d Place(double s, double angle, double r) const {
    const LumenFrame frame = At(s);
    return frame.position + r * (std::cos(angle) * frame.normal + std::sin(angle) * frame.binormal);
  }
  double Wall(double s, double angle) const { return wall ? wall(s, angle) : radius; }

  // Patches of the wall about `step` apart, where `is_there` says so.
  std::vector<WallPatch> Patches(double step, const std::function<bool(double, double)>& is_there = {}) const {
    std::vector<WallPatch> patches;
    const int around = static_cast<int>(std::ceil(2.0 * std::numbers::pi * radius / step));
    for (double s = 0.5 * step; s < length; s += step) {
      for (int k = 0; k < around; ++k) {
        const double angle = 2.0 * std::numbers::pi * (k + 0.5) / around - std::numbers::pi;
        if (!is_there || is_there(s, angle)) patches.push_back({Place(s, angle, Wall(s, angle)), step * step});
      }
    }
    return patches;
  }
  std::vector<Eigen::Vector3d> Points(double step, const std::function<bool(double, double)>& is_there = {}) const {
    std::vector<Eigen::Vector3d> points;
    for (const WallPatch& patch : Patches(step, is_there)) points.push_back(patch.position_in_map);
    return points;
  }
  // A lumen as it is, without looking for it; all of it passed.
  Lumen Known() const {
    std::vector<Eigen::Vector3d> centres;
    for (double s = 0.0; s <= length + 1e-9; s += 0.05 * radius) centres.push_back(At(s).position);
    Lumen lumen;
    lumen.line = LumenLine(centres, 0.1 * radius);
    lumen.radius_mu = radius;
    lumen.passed_end_mu = lumen.line.length_mu();
    return lumen;
  }
  // A scope that goes in and out, off the middle by up to `off`.
  std::vector<Eigen::Vector3d> InAndOut(double begin, double end, double off) const {
    std::vector<Eigen::Vector3d> path;
    for (int i = 0; i <= 200; ++i) {
      const double share = i <= 100 ? i / 100.0 : (200 - i) / 100.0;
      const double s = begin + share * (end - begin);
      path.push_back(Place(s, 0.05 * i, off * (0.7 + 0.3 * std::sin(0.3 * i))));
    }
    return path;
  }
};

}  // namespace haustra
