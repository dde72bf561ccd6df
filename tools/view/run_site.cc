#include "tools/view/run_site.h"

#include <filesystem>
#include <map>

#include "tools/evaluate/run_output.h"
#include "tools/evaluate/text_input.h"
#include "tools/report/map_model.h"
#include "tools/report/surface_folder.h"
#include "tools/view/page_site.h"
#include "tools/view/run_data.h"

namespace haustra::view {
namespace {

// Meshes of the maps as they are; the page reads them.
Result<std::map<int, std::string>> AddSurfaces(const std::string& folder, const std::map<int, report::MapModel>& models,
                                               ViewSite* site) {
  std::map<int, std::string> names;
  for (const auto& [map_id, model] : models) {
    const std::string name = report::MapFolderName(map_id) + ".ply";
    const std::string path = (std::filesystem::path(folder) / name).string();
    if (!std::filesystem::is_regular_file(path)) continue;
    HAUSTRA_ASSIGN(std::string bytes, evaluate::ReadText(path));
    if (!bytes.starts_with("ply\n")) return InvalidArgument(path + ": not a PLY file");
    site->resources[name] = {"application/octet-stream", std::move(bytes)};
    names[map_id] = name;
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
    HAUSTRA_ASSIGN(surfaces, AddSurfaces(folder, models, &site));
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
