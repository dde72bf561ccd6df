#include "tools/report/surface_meshes.h"

#include <filesystem>
#include <utility>

#include "capture/files/whole_file.h"

namespace haustra::report {

Result<std::map<int, std::string>> ReadSurfaceMeshes(const std::string& folder, const std::map<int, MapModel>& models) {
  std::map<int, std::string> meshes;
  for (const auto& [map_id, model] : models) {
    const std::string path = (std::filesystem::path(folder) / (MapFolderName(map_id) + ".ply")).string();
    if (!std::filesystem::is_regular_file(path)) continue;
    HAUSTRA_ASSIGN(std::string bytes, ReadWholeText(path));
    if (!bytes.starts_with("ply\n")) return InvalidArgument(path + ": not a PLY file");
    meshes[map_id] = std::move(bytes);
  }
  return meshes;
}

}  // namespace haustra::report
