#include "tools/report/surface_meshes.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "capture/files/whole_file.h"

namespace haustra::report {
namespace {

// By map id, where surface.json has it: surfaces of before there was a checksum pass.
Result<std::map<int, std::string>> ReadChecksums(const std::string& folder) {
  std::map<int, std::string> checksums;
  const std::filesystem::path path = std::filesystem::path(folder) / "surface.json";
  if (!std::filesystem::is_regular_file(path)) return checksums;
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path.string()));
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.value("maps", nlohmann::json()).is_array()) {
    return InvalidArgument(path.string() + ": not what haustra surface writes");
  }
  for (const nlohmann::json& map : json["maps"]) {
    if (!map.is_object()) continue;
    const nlohmann::json id = map.value("map_id", nlohmann::json());
    const nlohmann::json checksum = map.value("poses_checksum", nlohmann::json());
    if (id.is_number_integer() && checksum.is_string()) checksums[id.get<int>()] = checksum.get<std::string>();
  }
  return checksums;
}

}  // namespace

Result<std::map<int, std::string>> ReadSurfaceMeshes(const std::string& folder, const std::map<int, MapModel>& models) {
  HAUSTRA_ASSIGN(const auto checksums, ReadChecksums(folder));
  std::map<int, std::string> meshes;
  for (const auto& [map_id, model] : models) {
    const std::string path = (std::filesystem::path(folder) / (MapFolderName(map_id) + ".ply")).string();
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
