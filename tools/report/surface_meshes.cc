#include "tools/report/surface_meshes.h"

#include <filesystem>
#include <utility>

#include "capture/files/whole_file.h"
#include "tools/run/map_name.h"

namespace haustra::report {
namespace {

using Json = nlohmann::ordered_json;

// By map id: surfaces of before there was a checksum have none, and pass.
Result<std::map<int, std::string>> ReadChecksums(const std::string& folder) {
  HAUSTRA_ASSIGN(const Json maps, ReadMapsOfSurface(folder));
  std::map<int, std::string> checksums;
  for (const Json& map : maps) {
    if (!map.is_object()) continue;
    const Json id = map.value("map_id", Json()), checksum = map.value("poses_checksum", Json());
    if (id.is_number_integer() && checksum.is_string()) checksums[id.get<int>()] = checksum.get<std::string>();
  }
  return checksums;
}

}  // namespace

Result<Json> ReadMapsOfSurface(const std::string& folder) {
  const std::filesystem::path path = std::filesystem::path(folder) / "surface.json";
  if (!std::filesystem::is_regular_file(path)) return Json::array();
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path.string()));
  const Json surface = Json::parse(text, nullptr, false);
  const auto maps = surface.find("maps");
  if (!surface.is_object() || maps == surface.end() || !maps->is_array()) {
    return InvalidArgument(path.string() + ": not what haustra surface writes");
  }
  return *maps;
}

Result<std::map<int, std::string>> ReadSurfaceMeshes(const std::string& folder, const std::map<int, MapModel>& models) {
  std::map<int, std::string> meshes;
  if (!std::filesystem::is_regular_file(std::filesystem::path(folder) / "surface.json")) return meshes;
  HAUSTRA_ASSIGN(const auto checksums, ReadChecksums(folder));
  for (const auto& [map_id, model] : models) {
    const std::string path = (std::filesystem::path(folder) / (MapName(map_id) + ".ply")).string();
    if (!std::filesystem::is_regular_file(path)) continue;
    const auto checksum = checksums.find(map_id);
    if (checksum != checksums.end() && checksum->second != ChecksumOfPoses(model)) {
      return InvalidArgument(path + ": made of the map of another run; make the surface of this one again");
    }
    HAUSTRA_ASSIGN(std::string bytes, ReadWholeText(path));
    if (!bytes.starts_with("ply\n")) return InvalidArgument(path + ": not a PLY file");
    meshes[map_id] = std::move(bytes);
  }
  return meshes;
}

}  // namespace haustra::report
