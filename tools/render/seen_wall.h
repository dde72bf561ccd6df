// Which part of the wall the pictures of a sequence show: the truth for the coverage of a map. Found in the visibility
// buffer of each frame, so that a fold hides what lies behind it.
//
// The wall is taken in cells of kRings rings by kVertices vertices of the mesh, about 2.2 mm. A cell is seen when half
// of its quads were, in any frame. What counts as well is what CoverageOptions says (engine/coverage), with the mean
// radius of the colon at rest. A cell that moves with the wall stays the same cell. thread-bound(its owner).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/coverage/coverage_options.h"
#include "tools/render/colon_mesh.h"

namespace haustra::render {

enum class SeenAs : std::uint8_t { kNever, kPoorly, kWell };

class SeenWall {
 public:
  static constexpr int kRings = 4;
  static constexpr int kVertices = 3;
  static constexpr int kAngles = ColonMesh::kVerticesPerRing / kVertices;

  struct Cell {
    double arc_mm = 0.0;  // of the centre line
    double angle_rad = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // world, mm, at rest
    Eigen::Vector3d normal = Eigen::Vector3d::UnitX();   // unit, into the lumen
    double area_mm2 = 0.0;
  };

  // Keeps nothing of the mesh. options.Validate() must be ok.
  SeenWall(const ColonMesh& mesh, const CoverageOptions& options);

  double radius_mm() const { return radius_mm_; }  // mean of the wall
  int num_rows() const { return num_rows_; }
  const Cell& cell(int row, int column) const { return cells_[std::size_t(row) * kAngles + column]; }

  // A picture shows the quad between a ring and the next, and a vertex and the next, from range_mm away along the unit
  // ray (world). What is facing away, too far or in no cell is left out.
  void Note(int ring, int vertex, double range_mm, const Eigen::Vector3d& ray_in_world);
  // Takes in what another one of the same mesh has noted.
  void Add(const SeenWall& other);

  SeenAs SeenAt(int row, int column) const;
  // row,column,arc_mm,angle_deg,x_mm,y_mm,z_mm,area_mm2,seen; seen is "well", "poorly" or "never".
  std::string Csv() const;

 private:
  double radius_mm_ = 0.0;
  double far_mm_ = 0.0, near_mm_ = 0.0, min_cosine_ = 0.0;
  int num_rows_ = 0;
  std::vector<Cell> cells_;
  std::vector<SeenAs> quads_;  // kVerticesPerRing a ring
};

}  // namespace haustra::render
