#include "tools/surface/surface_input.h"

#include <filesystem>
#include <unordered_map>
#include <utility>

#include "tools/report/map_model.h"
#include "tools/run/map_name.h"

namespace haustra::surface {

Result<std::vector<SurfaceMap>> ReadSurfaceMaps(const evaluate::RunOutput& run) {
  std::vector<SurfaceMap> maps;
  for (const auto& [map_id, geometry] : run.geometry) {
    const std::filesystem::path folder = std::filesystem::path(run.folder) / "maps" / MapName(map_id);
    HAUSTRA_ASSIGN(const report::MapModel model, report::ReadMapModel(folder.string()));
    std::unordered_map<std::int64_t, std::size_t> point_of_id;
    for (std::size_t i = 0; i < model.point_ids.size(); ++i) point_of_id[model.point_ids[i]] = i;
    SurfaceMap& map = maps.emplace_back();
    map.map_id = map_id;
    map.poses_checksum = report::ChecksumOfPoses(model);
    map.camera = geometry.camera;
    map.depth_mu = geometry.depth_mu;
    for (const auto& [keyframe_id, seen] : model.keyframes) {
      SurfaceKeyframe& keyframe = map.keyframes.emplace_back();
      keyframe.keyframe_id = keyframe_id;
      keyframe.image_name = seen.image_name;
      keyframe.cam_from_map = seen.cam_from_map;
      keyframe.view.centre_in_map = seen.cam_from_map.InverseTranslation();
      for (const auto& [point_id, pixel] : seen.pixels) {
        const auto point = point_of_id.find(point_id);
        if (point == point_of_id.end()) continue;
        keyframe.view.points.push_back({point_id, model.points[point->second]});
        keyframe.pixels.push_back(pixel);
      }
    }
  }
  if (maps.empty()) return FailedPrecondition(run.folder + ": the run has no map");
  return maps;
}

}  // namespace haustra::surface
