#include "tools/render/seen_wall.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace haustra::render {
namespace {

constexpr int kM = ColonMesh::kVerticesPerRing;

const char* ToText(SeenAs seen) {
  switch (seen) {
    case SeenAs::kWell: return "well";
    case SeenAs::kPoorly: return "poorly";
    case SeenAs::kNever: break;
  }
  return "never";
}

}  // namespace

SeenWall::SeenWall(const ColonMesh& mesh, const CoverageOptions& options) {
  double sum = 0.0;
  int count = 0;
  for (int ring = 0; ring < mesh.num_rings() && mesh.ring(ring).surface_mm < mesh.dome_surface_mm(); ++ring) {
    for (int j = 0; j < kM; ++j) sum += mesh.Radius(ring, j);
    count += kM;
  }
  radius_mm_ = count > 0 ? sum / count : 0.0;
  far_mm_ = options.far_radii * radius_mm_;
  near_mm_ = options.max_range_radii * radius_mm_;
  min_cosine_ = std::cos(options.max_slant_deg * std::numbers::pi / 180.0);
  num_rows_ = (mesh.num_rings() - 1) / kRings;
  quads_.resize(std::size_t(num_rows_) * kRings * kM, SeenAs::kNever);
  for (int row = 0; row < num_rows_; ++row) {
    for (int column = 0; column < kAngles; ++column) {
      Cell& cell = cells_.emplace_back();
      const int first = row * kRings, middle = first + kRings / 2;
      cell.arc_mm = 0.5 * (mesh.ring(first).arc_mm + mesh.ring(first + kRings).arc_mm);
      cell.angle_rad = 2.0 * std::numbers::pi * (column + 0.5) / kAngles;
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int k = 0; k <= kVertices; ++k) {
        cell.position += mesh.Position(middle, (column * kVertices + k) % kM, 1.0) / (kVertices + 1);
      }
      for (int i = first; i < first + kRings; ++i) {
        for (int k = 0; k < kVertices; ++k) {
          const int j = column * kVertices + k, next = (j + 1) % kM;
          // Half the product of the diagonals: the quad's area and normal.
          const Eigen::Vector3d quad = 0.5 * (mesh.Position(i + 1, next, 1.0) - mesh.Position(i, j, 1.0))
                                                 .cross(mesh.Position(i, next, 1.0) - mesh.Position(i + 1, j, 1.0));
          normal += quad;
          cell.area_mm2 += quad.norm();
        }
      }
      if (normal.norm() > 0.0) cell.normal = normal.normalized();
    }
  }
}

void SeenWall::Note(int ring, int vertex, double range_mm, const Eigen::Vector3d& ray_in_world) {
  const int row = ring / kRings;
  if (ring < 0 || row >= num_rows_ || range_mm > far_mm_) return;
  const double cosine = -ray_in_world.dot(cell(row, vertex / kVertices).normal);
  if (cosine <= 0.0) return;
  const SeenAs seen = range_mm <= near_mm_ && cosine >= min_cosine_ ? SeenAs::kWell : SeenAs::kPoorly;
  SeenAs& quad = quads_[std::size_t(ring) * kM + vertex];
  quad = std::max(quad, seen);
}

void SeenWall::Add(const SeenWall& other) {
  for (std::size_t i = 0; i < quads_.size(); ++i) quads_[i] = std::max(quads_[i], other.quads_[i]);
}

SeenAs SeenWall::SeenAt(int row, int column) const {
  constexpr int kHalf = kRings * kVertices / 2;
  int well = 0, seen = 0;
  for (int i = row * kRings; i < (row + 1) * kRings; ++i) {
    for (int j = column * kVertices; j < (column + 1) * kVertices; ++j) {
      const SeenAs quad = quads_[std::size_t(i) * kM + j];
      well += quad == SeenAs::kWell ? 1 : 0;
      seen += quad != SeenAs::kNever ? 1 : 0;
    }
  }
  return well >= kHalf ? SeenAs::kWell : seen >= kHalf ? SeenAs::kPoorly : SeenAs::kNever;
}

std::string SeenWall::Csv() const {
  std::string text = "row,column,arc_mm,angle_deg,x_mm,y_mm,z_mm,area_mm2,seen\n";
  for (int row = 0; row < num_rows_; ++row) {
    for (int column = 0; column < kAngles; ++column) {
      const Cell& each = cell(row, column);
      char line[200];
      std::snprintf(line, sizeof(line), "%d,%d,%.3f,%.2f,%.4f,%.4f,%.4f,%.4f,%s\n", row, column, each.arc_mm,
                    each.angle_rad * 180.0 / std::numbers::pi, each.position.x(), each.position.y(), each.position.z(),
                    each.area_mm2, ToText(SeenAt(row, column)));
      text += line;
    }
  }
  return text;
}

}  // namespace haustra::render
