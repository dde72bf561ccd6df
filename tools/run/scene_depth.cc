#include "tools/run/scene_depth.h"

#include <algorithm>
#include <map>
#include <span>

#include "hal/core/median.h"
#include "hal/core/percentile.h"

namespace haustra {

std::optional<double> SceneDepthOf(const Keyframe& keyframe, const Atlas& atlas) {
  std::vector<double> depths;
  for (const MapPointHandle point : keyframe.points) {
    if (!point) continue;
    const double depth = (keyframe.cam_from_map * atlas.point(point).position).z();
    if (depth > 0.0) depths.push_back(depth);
  }
  if (depths.empty()) return std::nullopt;
  return UpperMedian(std::span(depths));
}

std::vector<SceneDepths> FindSceneDepths(const Atlas& atlas) {
  std::map<MapId, std::vector<double>> depths;
  atlas.keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) {
    if (const auto depth = SceneDepthOf(keyframe, atlas)) depths[atlas.map(keyframe.map).id].push_back(*depth);
  });
  std::vector<SceneDepths> all;
  for (auto& [map_id, of_map] : depths) {
    std::sort(of_map.begin(), of_map.end());
    const std::span<const double> sorted(of_map);
    all.push_back({map_id, sorted.size(), Percentile(sorted, 50), Percentile(sorted, 500), Percentile(sorted, 950)});
  }
  return all;
}

}  // namespace haustra
