#include "engine/coverage/lumen_line.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace haustra {

LumenLine::LumenLine(std::span<const Eigen::Vector3d> points, double step_mu) {
  double total = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i) total += (points[i] - points[i - 1]).norm();
  const int steps = std::max(1, static_cast<int>(std::lround(total / step_mu)));
  step_mu_ = total / steps;
  std::size_t piece = 1;
  double begin = 0.0;  // length at the start of the piece
  for (int i = 0; i <= steps; ++i) {
    const double at = std::min(i * step_mu_, total);
    double piece_length = (points[piece] - points[piece - 1]).norm();
    while (piece + 1 < points.size() && begin + piece_length < at) {
      begin += piece_length;
      ++piece;
      piece_length = (points[piece] - points[piece - 1]).norm();
    }
    const double share = piece_length > 0.0 ? std::clamp((at - begin) / piece_length, 0.0, 1.0) : 0.0;
    stations_.emplace_back().position = points[piece - 1] + share * (points[piece] - points[piece - 1]);
  }
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector3d chord = stations_[std::min(i + 1, steps)].position - stations_[std::max(i - 1, 0)].position;
    const double norm = chord.norm();
    stations_[i].tangent = norm > 0.0 ? Eigen::Vector3d(chord / norm) : Eigen::Vector3d::UnitZ();
  }
  stations_[0].normal = stations_[0].tangent.unitOrthogonal();
  for (int i = 0; i <= steps; ++i) {
    LumenFrame& here = stations_[i];
    if (i > 0) {
      const LumenFrame& last = stations_[i - 1];
      // Reflected in the plane between the two places, then in the one that brings the tangents together.
      const Eigen::Vector3d way = here.position - last.position;
      const double way_squared = std::max(way.squaredNorm(), std::numeric_limits<double>::min());
      const Eigen::Vector3d normal = last.normal - 2.0 / way_squared * way.dot(last.normal) * way;
      const Eigen::Vector3d tangent = last.tangent - 2.0 / way_squared * way.dot(last.tangent) * way;
      const Eigen::Vector3d turn = here.tangent - tangent;
      const double turn_squared = std::max(turn.squaredNorm(), std::numeric_limits<double>::min());
      here.normal = normal - 2.0 / turn_squared * turn.dot(normal) * turn;
      here.normal = (here.normal - here.normal.dot(here.tangent) * here.tangent).normalized();
    }
    here.binormal = here.tangent.cross(here.normal);
  }
}

LumenFrame LumenLine::At(double length_mu) const {
  const int last = num_stations() - 1;
  const double x = std::clamp(length_mu / step_mu_, 0.0, static_cast<double>(last));
  const int i = std::min(static_cast<int>(x), last - 1);
  const double t = x - i;
  const LumenFrame &a = stations_[i], &b = stations_[i + 1];
  LumenFrame frame;
  frame.tangent = ((1.0 - t) * a.tangent + t * b.tangent).normalized();
  frame.position = (1.0 - t) * a.position + t * b.position + (length_mu - x * step_mu_) * frame.tangent;
  const Eigen::Vector3d normal = (1.0 - t) * a.normal + t * b.normal;
  frame.normal = (normal - normal.dot(frame.tangent) * frame.tangent).normalized();
  frame.binormal = frame.tangent.cross(frame.normal);
  return frame;
}

WallCoordinates LumenLine::From(const Eigen::Vector3d& point_in_map, double guess_mu) const {
  constexpr int kSteps = 4;
  const int last = num_stations() - 1;
  double at = guess_mu;
  for (int k = 0; k < kSteps; ++k) {
    // Newton on the distance: the tangent turns by the curvature, so that a step inside a bend is longer.
    const double x = std::clamp(at / step_mu_, 0.0, static_cast<double>(last));
    const int i = std::min(static_cast<int>(x), last - 1);
    const double t = x - i;
    const LumenFrame &a = stations_[i], &b = stations_[i + 1];
    const Eigen::Vector3d tangent = (1.0 - t) * a.tangent + t * b.tangent;
    const Eigen::Vector3d offset =
        point_in_map - ((1.0 - t) * a.position + t * b.position + (at - x * step_mu_) * tangent);
    const double bend = at > 0.0 && at < length_mu() ? offset.dot(b.tangent - a.tangent) / step_mu_ : 0.0;
    at += offset.dot(tangent) / (tangent.squaredNorm() * std::clamp(1.0 - bend, 0.3, 3.0));
  }
  const LumenFrame frame = At(at);
  const Eigen::Vector3d offset = point_in_map - frame.position;
  const double x = offset.dot(frame.normal), y = offset.dot(frame.binormal);
  return {at, std::atan2(y, x), std::hypot(x, y)};
}

WallCoordinates LumenLine::Of(const Eigen::Vector3d& point_in_map) const {
  int nearest = 0;
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < num_stations(); ++i) {
    const double distance = (stations_[i].position - point_in_map).squaredNorm();
    if (distance < best) best = distance, nearest = i;
  }
  return From(point_in_map, nearest * step_mu_);
}

}  // namespace haustra
