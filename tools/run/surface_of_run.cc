#include "tools/run/surface_of_run.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tools/report/surface_folder.h"
#include "tools/surface/coverage_text.h"
#include "tools/surface/run_surface.h"
#include "tools/surface/surface_content.h"
#include "tools/surface/surface_text.h"

namespace haustra {
namespace {

Status MakeOf(const std::string& run_folder, const std::string& surface_folder, const surface::SurfaceOptions& options,
              SurfaceFigures* figures) {
  HAUSTRA_ASSIGN(const evaluate::RunOutput run, evaluate::ReadRunOutput(run_folder));
  if (run.geometry.empty()) {
    figures->why_not = "the run has no map";
    return Status::Ok();
  }
  surface::SurfaceRequest request;
  request.surface = options;
  HAUSTRA_ASSIGN(const surface::RunSurface made, surface::MakeRunSurface(run, request));
  figures->why_not = surface::WhatIsMissing(made);
  if (!figures->why_not.empty()) return Status::Ok();
  HAUSTRA_TRY(surface::WriteRunSurface({surface_folder}, made, {}));
  nlohmann::ordered_json maps = surface::ToJson(made.maps, made.coverages);
  for (std::size_t i = 0; i < made.maps.size(); ++i) {
    const int map_id = made.maps[i].map_id;
    maps[i]["refused_blocks"] = made.surfaces[i].num_refused_blocks;
    figures->lines.push_back(surface::ToText(map_id, made.coverages[i]));
    const std::string full = surface::FullText(map_id, made.surfaces[i]);
    if (!full.empty()) figures->lines.push_back(full);
  }
  figures->maps_json = maps.dump();
  return Status::Ok();
}

}  // namespace

Status MakeSurfaceOfRun(const std::string& folder, const surface::SurfaceOptions& options, SurfaceFigures* figures) {
  const std::string surface_folder = (std::filesystem::path(folder) / report::kSurfaceFolder).string();
  Status status = OutputFolder::Check(surface_folder, surface::kSurfaceContent, false);
  if (status.ok()) status = MakeOf(folder, surface_folder, options, figures);
  if (!status.ok()) figures->why_not = status.message();
  if (status.code() == StatusCode::kCancelled) figures->why_not = "it was stopped; haustra surface makes it";
  return status;
}

}  // namespace haustra
