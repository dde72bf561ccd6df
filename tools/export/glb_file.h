// A binary glTF 2.0 file as it grows: one node for a map, and meshes below it. glTF's y axis points up and the camera's
// down: the node of the map is turned by half a turn about x. Colours are as the camera saw them: no light falls on
// them. thread-bound(its owner).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/io/byte_order.h"

namespace haustra::exporting {

// Of a primitive; numbers of the specification.
inline constexpr int kGlbPoints = 0, kGlbLines = 1, kGlbTriangles = 4;

class GlbFile {
 public:
  explicit GlbFile(int map_id);

  // Each returns the accessor. Not empty; colours have one entry a position.
  int AddPositions(const std::vector<Eigen::Vector3f>& positions);
  int AddColours(const std::vector<std::array<std::uint8_t, 3>>& colours);
  int AddIndices(const std::vector<std::uint32_t>& indices);
  // A mesh of one primitive, and its node below the map's.
  void AddMesh(const std::string& name, nlohmann::json primitive);

  // The whole file. Once.
  std::string Finish();

 private:
  void Begin() { begin_ = bytes_.size(); }
  int End(nlohmann::json accessor, int target, std::size_t count);

  nlohmann::json json_;
  std::string bytes_;
  ByteWriter writer_{&bytes_};
  std::size_t begin_ = 0;
};

}  // namespace haustra::exporting
