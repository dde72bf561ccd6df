// The part of the colon that a camera may see, in its coordinates and its image. Scratch memory of one thread: filled
// anew for every frame. thread-bound(its owner).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/camera/camera_model.h"
#include "tools/render/colon.h"
#include "tools/render/colon_mesh.h"
#include "tools/render/exposure_moment.h"

namespace haustra::render {

struct ProjectedMesh {
  static constexpr int kM = ColonMesh::kVerticesPerRing;

  struct Vertex {
    Eigen::Vector3f position;  // camera, mm
    Eigen::Vector3f normal;    // camera, into the lumen
    float x_px, y_px;          // image; only when in_front
    float inverse_range;       // 1/mm
    float radius_mm, openness;
    bool in_front;  // inside the camera model
  };
  struct Ring {
    Eigen::Vector3f axis;  // direction of the centre line, camera
    float surface_mm;
  };
  std::vector<Vertex> vertices;  // kM a ring
  std::vector<Ring> rings;
  int first_ring = 0;  // of the colon's mesh

  int num_rings() const { return static_cast<int>(rings.size()); }
  // Triangles are numbered 2 * (ring * kM + vertex) and + 1; corners in order.
  static void Corners(std::uint32_t triangle, int corners[3]) {
    const int quad = static_cast<int>(triangle >> 1);
    const int ring = quad / kM, j = quad % kM, k = j + 1 == kM ? 0 : j + 1;
    corners[0] = ring * kM + j;
    corners[1] = (triangle & 1) == 0 ? (ring + 1) * kM + j : (ring + 1) * kM + k;
    corners[2] = (triangle & 1) == 0 ? (ring + 1) * kM + k : ring * kM + k;
  }

  // Rings from 45 mm behind the camera's place along the centre line to 170 mm before it, with the wall deformed as it
  // is at that time.
  // rows_seen: one moment for the whole picture, or one for each of its rows (a rolling shutter). In the second case
  // a vertex is given in the camera as it is when the row is read in which the vertex is seen; the axes are those
  // of the middle row.
  void Project(const Colon& colon, const CameraModel& camera, std::span<const ExposureMoment> rows_seen);
};

}  // namespace haustra::render
