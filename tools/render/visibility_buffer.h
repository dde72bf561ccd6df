// Which triangle of the projected mesh is nearest at each of 2 x 2 samples of every pixel. Sample (i, j) of the buffer
// lies at pixel ((i - 0.5) / 2, (j - 0.5) / 2): a quarter of a pixel about the pixel centres.
// Edges of triangles are taken as straight in the image: with triangles this small the fisheye bends them by less than
// a sample. The exact place on the triangle is left to the caller (ray against plane). thread-bound(its owner).
#pragma once

#include <cstdint>
#include <vector>

#include "tools/render/projected_mesh.h"

namespace haustra::render {

class VisibilityBuffer {
 public:
  static constexpr std::uint32_t kNothing = 0xffffffffu;

  VisibilityBuffer(int width_px, int height_px);

  void Rasterise(const ProjectedMesh& mesh);

  std::uint32_t triangle(int i, int j) const { return triangle_[std::size_t(j) * columns_ + i]; }
  // Approximate, mm; 0 where there is nothing.
  float inverse_range(int i, int j) const { return inverse_range_[std::size_t(j) * columns_ + i]; }

 private:
  void Draw(std::uint32_t triangle, const ProjectedMesh::Vertex& a, const ProjectedMesh::Vertex& b,
            const ProjectedMesh::Vertex& c);

  int columns_, rows_;
  std::vector<std::uint32_t> triangle_;
  std::vector<float> inverse_range_;
};

}  // namespace haustra::render
