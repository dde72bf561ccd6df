// A surface of triangles with a colour a vertex. Plain data. Frame: the map, map units.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace haustra {

struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::array<std::uint8_t, 3>> rgb;         // one a position
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise, seen from the side of the cameras
};

}  // namespace haustra
