#include "kernels/cpu/sift_refinement.h"

#include <cmath>

namespace haustra::kernels {
namespace {

// Value, gradient and Hessian of the difference of Gaussians at a grid point, by central differences.
struct Quadratic {
  float value;
  float gx, gy, gs;
  float hxx, hyy, hss, hxy, hxs, hys;
};

Quadratic FitQuadratic(const Plane* levels, int x, int y, int level) {
  float d[3][3][3];  // scale, row, column
  const std::ptrdiff_t stride = levels[0].stride;
  for (int s = 0; s < 3; ++s) {
    const float* fine = levels[level - 1 + s].row(y) + x;
    const float* coarse = levels[level + s].row(y) + x;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const std::ptrdiff_t at = (r - 1) * stride + (c - 1);
        d[s][r][c] = coarse[at] - fine[at];
      }
    }
  }
  Quadratic q;
  q.value = d[1][1][1];
  q.gx = 0.5f * (d[1][1][2] - d[1][1][0]);
  q.gy = 0.5f * (d[1][2][1] - d[1][0][1]);
  q.gs = 0.5f * (d[2][1][1] - d[0][1][1]);
  q.hxx = d[1][1][2] + d[1][1][0] - 2.0f * q.value;
  q.hyy = d[1][2][1] + d[1][0][1] - 2.0f * q.value;
  q.hss = d[2][1][1] + d[0][1][1] - 2.0f * q.value;
  q.hxy = 0.25f * (d[1][2][2] - d[1][2][0] - d[1][0][2] + d[1][0][0]);
  q.hxs = 0.25f * (d[2][1][2] - d[2][1][0] - d[0][1][2] + d[0][1][0]);
  q.hys = 0.25f * (d[2][2][1] - d[2][0][1] - d[0][2][1] + d[0][0][1]);
  return q;
}

// Where the gradient vanishes: -H^-1 g, by cofactors. False when H is singular.
bool SolveOffset(const Quadratic& q, float* dx, float* dy, float* ds) {
  const float c00 = q.hyy * q.hss - q.hys * q.hys;
  const float c01 = q.hxs * q.hys - q.hxy * q.hss;
  const float c02 = q.hxy * q.hys - q.hxs * q.hyy;
  const float c11 = q.hxx * q.hss - q.hxs * q.hxs;
  const float c12 = q.hxy * q.hxs - q.hxx * q.hys;
  const float c22 = q.hxx * q.hyy - q.hxy * q.hxy;
  const float determinant = q.hxx * c00 + q.hxy * c01 + q.hxs * c02;
  if (std::fabs(determinant) < 1e-30f) return false;
  const float factor = -1.0f / determinant;
  *dx = factor * (c00 * q.gx + c01 * q.gy + c02 * q.gs);
  *dy = factor * (c01 * q.gx + c11 * q.gy + c12 * q.gs);
  *ds = factor * (c02 * q.gx + c12 * q.gy + c22 * q.gs);
  return true;
}

}  // namespace

bool RefineExtremum(const Plane* levels, const Extremum& extremum, const RefinementOptions& options,
                    ScaleSpacePoint* point) {
  int x = extremum.x;
  int y = extremum.y;
  int level = extremum.level;
  Quadratic q;
  float dx = 0.0f;
  float dy = 0.0f;
  float ds = 0.0f;
  bool has_settled = false;
  for (int step = 0; step < kMaxRefinementSteps; ++step) {
    q = FitQuadratic(levels, x, y, level);
    if (!SolveOffset(q, &dx, &dy, &ds)) return false;
    if (std::fabs(dx) < 0.5f && std::fabs(dy) < 0.5f && std::fabs(ds) < 0.5f) {
      has_settled = true;
      break;
    }
    // Far away: the quadratic says nothing about this neighbourhood. (Negated to catch NaN.)
    if (!(std::fabs(dx) < 8.0f && std::fabs(dy) < 8.0f && std::fabs(ds) < 8.0f)) return false;
    x += static_cast<int>(std::lround(dx));
    y += static_cast<int>(std::lround(dy));
    level += static_cast<int>(std::lround(ds));
    if (level < 1 || level > kScalesPerOctave || x < kEdgeMarginPx || x >= levels[0].width - kEdgeMarginPx ||
        y < kEdgeMarginPx || y >= levels[0].height - kEdgeMarginPx) {
      return false;
    }
  }
  if (!has_settled) return false;

  const float response = std::fabs(q.value + 0.5f * (q.gx * dx + q.gy * dy + q.gs * ds));
  if (response < options.contrast_threshold) return false;
  // Ratio of the principal curvatures, 4.1.
  const float trace = q.hxx + q.hyy;
  const float determinant = q.hxx * q.hyy - q.hxy * q.hxy;
  const float edge = options.edge_threshold;
  if (determinant <= 0.0f || trace * trace * edge >= (edge + 1.0f) * (edge + 1.0f) * determinant) return false;

  point->x = static_cast<float>(x) + dx;
  point->y = static_cast<float>(y) + dy;
  point->scale = kBaseSigma * std::exp2((static_cast<float>(level) + ds) / kScalesPerOctave);
  point->response = response;
  point->level = static_cast<std::int16_t>(level);
  point->is_dark = q.value > 0.0f;
  return true;
}

}  // namespace haustra::kernels
