#include "tools/report/run_report.h"

#include <filesystem>
#include <map>
#include <utility>

#include "tools/report/page.h"
#include "tools/report/surface_folder.h"
#include "tools/report/surface_meshes.h"
#include "tools/report/wall_pictures.h"

namespace haustra::report {
namespace {

// surface.json is the last file of a surface: one that was not finished is none. Empty: there is none.
std::string SurfaceOf(const ReportRequest& request) {
  if (!request.surface.empty()) return request.surface;
  const std::filesystem::path usual = std::filesystem::path(request.run) / kSurfaceFolder;
  return std::filesystem::exists(usual / "surface.json") ? usual.string() : std::string();
}

}  // namespace

Result<std::string> MakeRunReport(const ReportRequest& request) {
  evaluate::Reference reference;
  if (!request.groundtruth.empty()) {
    HAUSTRA_ASSIGN(reference, evaluate::ReadReference(request.groundtruth, request.events));
  }
  HAUSTRA_ASSIGN(const evaluate::RunOutput run, evaluate::ReadRunOutput(request.run));
  HAUSTRA_ASSIGN(const auto models, ReadMapModels(run));
  const evaluate::Evaluation evaluation = evaluate::EvaluateRun(run, reference, request.options);
  std::string pictures;
  if (!request.pictures.sequence.empty()) {
    HAUSTRA_ASSIGN(pictures, JoinPicturesHtml(run, evaluation, models, request.pictures));
  }
  std::string walls;
  std::map<int, std::string> meshes;
  std::string surface_json = "[]";
  if (const std::string surface = SurfaceOf(request); !surface.empty()) {
    HAUSTRA_ASSIGN(walls, WallPicturesHtml(surface));
    HAUSTRA_ASSIGN(meshes, ReadSurfaceMeshes(surface, models));
    HAUSTRA_ASSIGN(const auto maps, ReadMapsOfSurface(surface));
    surface_json = maps.dump();
  }
  return MakePage({run, reference, evaluation, models, pictures, walls, meshes, surface_json});
}

}  // namespace haustra::report
