// CameraModel::Project with its Jacobian for as many points at once as the vectors of the including file have lanes
// (engine/geometry/lanes.h, whose rules hold here too). The formulas are those of camera_model.cc, without branches
// between lanes; results differ from it by rounding only.
#pragma once

#include "engine/geometry/lanes.h"
#include "hal/projection_constants.h"

namespace haustra {
namespace {

struct LaneProjection {
  VecMask is_seen;  // where it is not, the rest is anything, also not finite
  VecD u, v;
  VecD jacobian[2][3];  // d (u, v) / d point
};

// Angle to the axis of a point at distance `rho` >= 0 from it and `d` from the origin, [0, pi]. Within 1e-15.
inline VecD AngleToAxis(VecD rho, VecD z, VecD d) {
  // tan(angle / 2) = rho / (d + z); for points behind, that of the supplement, so that nothing cancels. Above tan(pi /
  // 8) another pi / 4 is taken off: atan(n / m) = pi / 4 + atan((n - m) / (n + m)).
  VecD numerator = rho, denominator = d + Abs(z);
  const VecMask is_wide = numerator > 0.41421356237309503 * denominator;
  const VecD difference = numerator - denominator, sum = numerator + denominator;
  numerator = Select(is_wide, difference, numerator);
  denominator = Select(is_wide, sum, denominator);
  const VecD t = numerator / denominator, t2 = t * t;
  // atan(t) / t for |t| <= tan(pi / 8), interpolated at the Chebyshev nodes of t^2: error 4e-17.
  constexpr double kAtan[] = {1.0,
                              -0.3333333333332844,
                              0.199999999988551,
                              -0.1428571418097571,
                              0.11111106180425145,
                              -0.09090773074092884,
                              0.07689953486227682,
                              -0.06640233842869744,
                              0.056883487686028446,
                              -0.04348050891958043,
                              0.02113535694575133};
  // Even and odd powers apart: two short chains instead of a long one.
  constexpr int kNum = sizeof kAtan / sizeof *kAtan;
  static_assert(kNum % 2 == 1);
  const VecD t4 = t2 * t2;
  VecD even = Splat(kAtan[kNum - 1]), odd = Splat(kAtan[kNum - 2]);
  for (int i = kNum - 3; i > 0; i -= 2) {
    even = even * t4 + kAtan[i];
    odd = odd * t4 + kAtan[i - 1];
  }
  const VecD polynomial = (even * t4 + kAtan[0]) + odd * t2;
  constexpr double kPi = 3.14159265358979323846;
  const VecD acute = Select(is_wide, Splat(0.5 * kPi), VecD{}) + 2.0 * t * polynomial;
  return Select(z < VecD{}, kPi - acute, acute);
}

// Radius in the distorted plane of the fisheye models at an angle with this sine and cosine, and its derivative.
inline VecD RadiusOfAngle(const ProjectionConstants& camera, VecD angle, VecD sine, VecD cosine, VecD* derivative) {
  const double* const k = camera.coefficients;
  if (camera.kind == CameraModelKind::kKannalaBrandt) {
    const VecD a2 = angle * angle;
    *derivative = 1.0 + a2 * (3.0 * k[0] + a2 * (5.0 * k[1] + a2 * (7.0 * k[2] + a2 * (9.0 * k[3]))));
    return angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
  }
  VecD radius{};
  for (int i = 0; i < kLanes; ++i) {
    const double position = angle[i] * camera.table_intervals_per_unit;
    // Also when the angle is not finite or beyond the model.
    const double last = camera.num_table_intervals - 1;
    const int interval = static_cast<int>(position > 0.0 ? (position < last ? position : last) : 0.0);
    const double* const at = camera.inverse_table + interval;
    radius[i] = at[0] + (position - interval) * (at[1] - at[0]);
  }
  // The table is good to 1e-5 of the radius; each step squares that.
  constexpr int kNewtonSteps = 3;
  VecD depth, slope;
  for (int i = 0; i <= kNewtonSteps; ++i) {
    depth = k[0] + radius * radius * (k[1] + radius * (k[2] + radius * k[3]));
    slope = radius * (2.0 * k[1] + radius * (3.0 * k[2] + radius * (4.0 * k[3])));
    if (i < kNewtonSteps) radius -= (depth * sine - radius * cosine) / (slope * sine - cosine);
  }
  *derivative = (depth * cosine + radius * sine) / (cosine - slope * sine);
  return radius;
}

inline void ProjectPinhole(const ProjectionConstants& camera, VecD x, VecD y, VecD z, LaneProjection* out) {
  const double* const k = camera.coefficients;
  const double p1 = k[2], p2 = k[3];
  const VecD rho2 = x * x + y * y;
  out->is_seen = (z > VecD{}) & (Sqrt(rho2) <= z * camera.max_tangent);
  const VecD inverse_z = 1.0 / z;
  const VecD mx = x * inverse_z, my = y * inverse_z;
  const VecD r2 = mx * mx + my * my;
  const VecD radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const VecD slope = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * (3.0 * k[4])));
  out->u = mx * radial + 2.0 * p1 * mx * my + p2 * (r2 + 2.0 * mx * mx);
  out->v = my * radial + p1 * (r2 + 2.0 * my * my) + 2.0 * p2 * mx * my;
  // Of the distortion, then of the division by z.
  const VecD xx = (radial + slope * mx * mx + 2.0 * p1 * my + 6.0 * p2 * mx) * inverse_z;
  const VecD xy = (slope * mx * my + 2.0 * (p1 * mx + p2 * my)) * inverse_z;
  const VecD yy = (radial + slope * my * my + 6.0 * p1 * my + 2.0 * p2 * mx) * inverse_z;
  out->jacobian[0][0] = xx;
  out->jacobian[0][1] = xy;
  out->jacobian[0][2] = -(xx * mx + xy * my);
  out->jacobian[1][0] = xy;
  out->jacobian[1][1] = yy;
  out->jacobian[1][2] = -(xy * mx + yy * my);
}

inline void ProjectFisheye(const ProjectionConstants& camera, VecD x, VecD y, VecD z, LaneProjection* out) {
  const VecD rho2 = x * x + y * y;
  const VecD rho = Sqrt(rho2);
  const VecMask is_on_axis = (rho < 1e-9 * Abs(z)) | (rho == VecD{});
  const VecD d2 = rho2 + z * z;
  const VecD d = Sqrt(d2);
  // One division for two.
  const VecD safe_rho = Select(is_on_axis, d, rho);
  const VecD inverse_product = 1.0 / (safe_rho * d);
  const VecD inverse_rho = inverse_product * d, inverse_d = inverse_product * safe_rho;
  const VecD angle = AngleToAxis(rho, z, d);
  VecD slope;
  const VecD radius = RadiusOfAngle(camera, angle, rho * inverse_d, z * inverse_d, &slope);
  // Along the radius the curve's slope counts, across it the ratio radius / rho; on the axis they are one, and k is
  // zero.
  const VecD inverse_d2 = inverse_d * inverse_d;
  const VecD along = slope * z * inverse_d2;
  const VecD scale = Select(is_on_axis, along, radius * inverse_rho);
  const VecD k = (along - scale) * inverse_rho * inverse_rho;
  const VecD depth = -slope * inverse_d2;
  out->is_seen = Select(is_on_axis, z, camera.max_half_angle_rad - angle) >= VecD{};
  out->is_seen &= d2 > VecD{};
  out->u = scale * x;
  out->v = scale * y;
  out->jacobian[0][0] = scale + k * x * x;
  out->jacobian[0][1] = out->jacobian[1][0] = k * x * y;
  out->jacobian[0][2] = depth * x;
  out->jacobian[1][1] = scale + k * y * y;
  out->jacobian[1][2] = depth * y;
}

inline LaneProjection ProjectLanes(const ProjectionConstants& camera, VecD x, VecD y, VecD z) {
  LaneProjection out;
  if (camera.kind == CameraModelKind::kPinhole) {
    ProjectPinhole(camera, x, y, z, &out);
  } else {
    ProjectFisheye(camera, x, y, z, &out);
  }
  const double* const a = camera.pixel_from_distorted;
  const VecD u = out.u, v = out.v;
  out.u = a[0] * u + a[1] * v + camera.cx;
  out.v = a[2] * u + a[3] * v + camera.cy;
  for (int i = 0; i < 3; ++i) {
    const VecD du = out.jacobian[0][i], dv = out.jacobian[1][i];
    out.jacobian[0][i] = a[0] * du + a[1] * dv;
    out.jacobian[1][i] = a[2] * du + a[3] * dv;
  }
  return out;
}

}  // namespace
}  // namespace haustra
