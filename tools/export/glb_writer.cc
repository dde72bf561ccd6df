#include "tools/export/glb_writer.h"

#include <vector>

#include "tools/export/glb_file.h"

namespace haustra::exporting {

std::string GlbBytes(const ExportedMap& map) {
  GlbFile file(map.map_id);
  if (!map.points.empty()) {
    std::vector<Eigen::Vector3f> points;
    points.reserve(map.points.size());
    for (const Eigen::Vector3d& point : map.points) points.push_back(point.cast<float>());
    const int positions = file.AddPositions(points), colours = file.AddColours(map.rgb);
    file.AddMesh("points", {{"mode", kGlbPoints}, {"attributes", {{"POSITION", positions}, {"COLOR_0", colours}}}});
  }
  std::vector<Eigen::Vector3f> path;
  std::vector<std::uint32_t> lines;
  for (std::size_t i = 0; i < map.frames.size(); ++i) {
    path.push_back(map.frames[i].world_from_cam.translation.cast<float>());
    if (i == 0 || map.frames[i].frame_idx != map.frames[i - 1].frame_idx + 1) continue;
    lines.insert(lines.end(), {static_cast<std::uint32_t>(i - 1), static_cast<std::uint32_t>(i)});
  }
  if (!lines.empty()) {
    const int positions = file.AddPositions(path), indices = file.AddIndices(lines);
    file.AddMesh("camera path", {{"mode", kGlbLines}, {"attributes", {{"POSITION", positions}}}, {"indices", indices}});
  }
  return file.Finish();
}

std::string MeshGlbBytes(const TriangleMesh& mesh, int map_id) {
  GlbFile file(map_id);
  if (!mesh.triangles.empty()) {
    std::vector<std::uint32_t> corners;
    corners.reserve(3 * mesh.triangles.size());
    for (const auto& triangle : mesh.triangles) corners.insert(corners.end(), triangle.begin(), triangle.end());
    const int positions = file.AddPositions(mesh.positions), colours = file.AddColours(mesh.rgb);
    const int indices = file.AddIndices(corners);
    file.AddMesh("surface", {{"mode", kGlbTriangles},
                             {"attributes", {{"POSITION", positions}, {"COLOR_0", colours}}},
                             {"indices", indices}});
  }
  return file.Finish();
}

}  // namespace haustra::exporting
