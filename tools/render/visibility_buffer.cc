#include "tools/render/visibility_buffer.h"

#include <algorithm>
#include <cmath>

namespace haustra::render {
namespace {

// Samples this close to an edge count for both neighbours, so that rounding leaves no holes.
constexpr float kEdgeSlack = 1e-3f;

float ToSample(float pixel) { return 2.0f * pixel + 0.5f; }

}  // namespace

VisibilityBuffer::VisibilityBuffer(int width_px, int height_px)
    : columns_(2 * width_px),
      rows_(2 * height_px),
      triangle_(std::size_t(columns_) * rows_, kNothing),
      inverse_range_(std::size_t(columns_) * rows_, 0.0f) {}

void VisibilityBuffer::Rasterise(const ProjectedMesh& mesh) {
  std::fill(triangle_.begin(), triangle_.end(), kNothing);
  std::fill(inverse_range_.begin(), inverse_range_.end(), 0.0f);
  const int num_triangles = std::max(mesh.num_rings() - 1, 0) * ProjectedMesh::kM * 2;
  for (int t = 0; t < num_triangles; ++t) {
    int corners[3];
    ProjectedMesh::Corners(static_cast<std::uint32_t>(t), corners);
    const ProjectedMesh::Vertex& a = mesh.vertices[corners[0]];
    const ProjectedMesh::Vertex& b = mesh.vertices[corners[1]];
    const ProjectedMesh::Vertex& c = mesh.vertices[corners[2]];
    if (a.in_front && b.in_front && c.in_front) Draw(static_cast<std::uint32_t>(t), a, b, c);
  }
}

void VisibilityBuffer::Draw(std::uint32_t triangle, const ProjectedMesh::Vertex& a, const ProjectedMesh::Vertex& b,
                            const ProjectedMesh::Vertex& c) {
  const float ax = ToSample(a.x_px), ay = ToSample(a.y_px);
  const float bx = ToSample(b.x_px), by = ToSample(b.y_px);
  const float cx = ToSample(c.x_px), cy = ToSample(c.y_px);
  const float area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  // Seen from inside the lumen the corners run one way round; the other way is the back of a fold.
  if (!(area < -1e-6f)) return;
  const int x0 = std::max(0, static_cast<int>(std::ceil(std::min({ax, bx, cx}) - kEdgeSlack)));
  const int x1 = std::min(columns_ - 1, static_cast<int>(std::floor(std::max({ax, bx, cx}) + kEdgeSlack)));
  const int y0 = std::max(0, static_cast<int>(std::ceil(std::min({ay, by, cy}) - kEdgeSlack)));
  const int y1 = std::min(rows_ - 1, static_cast<int>(std::floor(std::max({ay, by, cy}) + kEdgeSlack)));
  if (x0 > x1 || y0 > y1) return;

  // Barycentric weights of b and c are linear in the sample's coordinates.
  const float scale = 1.0f / area;
  const float wb_dx = (cy - ay) * scale, wb_dy = -(cx - ax) * scale;
  const float wc_dx = -(by - ay) * scale, wc_dy = (bx - ax) * scale;
  const float slack_b = kEdgeSlack * (std::abs(wb_dx) + std::abs(wb_dy));
  const float slack_c = kEdgeSlack * (std::abs(wc_dx) + std::abs(wc_dy));
  const float slack_a = slack_b + slack_c;
  const float range_b = b.inverse_range - a.inverse_range, range_c = c.inverse_range - a.inverse_range;
  for (int y = y0; y <= y1; ++y) {
    const float dy = static_cast<float>(y) - ay;
    const std::size_t row = std::size_t(y) * columns_;
    for (int x = x0; x <= x1; ++x) {
      const float dx = static_cast<float>(x) - ax;
      const float wb = wb_dx * dx + wb_dy * dy, wc = wc_dx * dx + wc_dy * dy;
      if (wb < -slack_b || wc < -slack_c || wb + wc > 1.0f + slack_a) continue;
      const float inverse_range = a.inverse_range + wb * range_b + wc * range_c;
      if (inverse_range > inverse_range_[row + x]) {
        inverse_range_[row + x] = inverse_range;
        triangle_[row + x] = triangle;
      }
    }
  }
}

}  // namespace haustra::render
