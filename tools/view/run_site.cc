#include "tools/view/run_site.h"

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "capture/files/whole_file.h"
#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"
#include "tools/report/surface_folder.h"
#include "tools/report/surface_meshes.h"
#include "tools/run/map_name.h"
#include "tools/view/page_site.h"
#include "tools/view/run_data.h"

namespace haustra::view {
namespace {

using Json = nlohmann::ordered_json;

void AddMeshes(std::map<int, std::string>&& meshes, ViewSite* site, std::map<int, ShownWall>* walls) {
  for (auto& [map_id, ply] : meshes) {
    ShownWall& wall = (*walls)[map_id];
    wall.mesh = MapName(map_id) + ".ply";
    site->resources[wall.mesh] = {"application/octet-stream", std::move(ply)};
  }
}

// What was looked at, of maps that have a mesh. A surface of before there was a coverage has none.
Status AddCoverage(const std::string& folder, ViewSite* site, std::map<int, ShownWall>* walls) {
  HAUSTRA_ASSIGN(const Json maps, report::ReadMapsOfSurface(folder));
  for (const Json& map : maps) {
    if (!map.is_object() || !map.value("map_id", Json()).is_number_integer() || !map.contains("lumen")) continue;
    const auto wall = walls->find(map["map_id"].get<int>());
    if (wall == walls->end()) continue;
    Json shown = {{"map", wall->first}, {"picture", nullptr}};
    shown.update(map);
    const std::string name = MapName(wall->first) + "_wall.png";
    if (const std::filesystem::path picture = std::filesystem::path(folder) / name;
        std::filesystem::is_regular_file(picture)) {
      HAUSTRA_ASSIGN(std::string png, ReadWholeText(picture.string()));
      site->resources[name] = {"image/png", std::move(png)};
      shown["picture"] = name;
    }
    wall->second.coverage = shown.dump();
  }
  return Status::Ok();
}

}  // namespace

Result<ViewSite> MakeRunSite(const RunSiteRequest& request) {
  HAUSTRA_ASSIGN(const evaluate::RunOutput run, evaluate::ReadRunOutput(request.run));
  HAUSTRA_ASSIGN(const auto models, report::ReadMapModels(run));
  ViewSite site = MakePageSite(PageKind::kRun);
  std::map<int, ShownWall> walls;
  const std::string usual = (std::filesystem::path(request.run) / report::kSurfaceFolder).string();
  const std::string folder = request.surface.empty() ? usual : request.surface;
  if (std::filesystem::is_directory(folder)) {
    HAUSTRA_ASSIGN(auto meshes, report::ReadSurfaceMeshes(folder, models));
    AddMeshes(std::move(meshes), &site, &walls);
    HAUSTRA_TRY(AddCoverage(folder, &site, &walls));
  } else if (!request.surface.empty()) {
    return NotFound(folder + ": no such folder");
  }
  if (walls.empty() && !request.surface.empty()) {
    return NotFound(folder + ": no whole surface of a map of this run (surface.json, map_NNNN.ply)");
  }
  site.resources["run.json"] = {"application/json", MakeRunData(run, models, walls)};
  return site;
}

}  // namespace haustra::view
