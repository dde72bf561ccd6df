#include "tools/export/exported_map.h"

#include <filesystem>
#include <map>
#include <utility>

#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"
#include "tools/run/map_name.h"

namespace haustra::exporting {

Result<ExportedMaps> ReadExportedMaps(const std::string& run) {
  HAUSTRA_ASSIGN(const evaluate::RunOutput output, evaluate::ReadRunOutput(run));
  std::map<int, ExportedMap> maps;
  for (const evaluate::RunFrame& frame : output.frames) {
    if (frame.map_id < 0) continue;
    maps[frame.map_id].frames.push_back({frame.frame_idx, frame.timestamp_ns, frame.world_from_cam});
  }
  ExportedMaps exported;
  exported.warnings = output.warnings;
  for (auto& [map_id, map] : maps) {
    map.map_id = map_id;
    const std::filesystem::path folder = std::filesystem::path(run) / "maps" / MapName(map_id);
    HAUSTRA_ASSIGN(report::MapModel model, report::ReadMapModel(folder.string()));
    map.points = std::move(model.points);
    map.rgb = std::move(model.rgb);
    exported.maps.push_back(std::move(map));
  }
  if (exported.maps.empty()) return FailedPrecondition(run + ": the run has no map");
  return exported;
}

}  // namespace haustra::exporting
