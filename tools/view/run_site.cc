#include "tools/view/run_site.h"

#include <filesystem>
#include <map>
#include <utility>

#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"
#include "tools/report/surface_folder.h"
#include "tools/report/surface_meshes.h"
#include "tools/view/page_site.h"
#include "tools/view/run_data.h"

namespace haustra::view {
namespace {

// The page reads them.
std::map<int, std::string> AddSurfaces(std::map<int, std::string> meshes, ViewSite* site) {
  std::map<int, std::string> names;
  for (auto& [map_id, ply] : meshes) {
    names[map_id] = report::MapFolderName(map_id) + ".ply";
    site->resources[names[map_id]] = {"application/octet-stream", std::move(ply)};
  }
  return names;
}

}  // namespace

Result<ViewSite> MakeRunSite(const RunSiteRequest& request) {
  HAUSTRA_ASSIGN(const evaluate::RunOutput run, evaluate::ReadRunOutput(request.run));
  HAUSTRA_ASSIGN(const auto models, report::ReadMapModels(run));
  ViewSite site = MakePageSite(PageKind::kRun);
  std::map<int, std::string> surfaces;
  const std::string usual = (std::filesystem::path(request.run) / report::kSurfaceFolder).string();
  const std::string folder = request.surface.empty() ? usual : request.surface;
  if (std::filesystem::is_directory(folder)) {
    HAUSTRA_ASSIGN(auto meshes, report::ReadSurfaceMeshes(folder, models));
    surfaces = AddSurfaces(std::move(meshes), &site);
  } else if (!request.surface.empty()) {
    return NotFound(folder + ": no such folder");
  }
  if (surfaces.empty() && !request.surface.empty()) {
    return NotFound(folder + ": no surface of a map of this run (map_NNNN.ply)");
  }
  site.resources["run.json"] = {"application/json", MakeRunData(run, models, surfaces)};
  return site;
}

}  // namespace haustra::view
