#include "tools/run/map_motion.h"

#include <iterator>
#include <map>

#include "tools/run/scene_depth.h"

namespace haustra {
namespace {

using DepthsByTime = std::map<TimePoint, double>;  // not empty

double DepthAt(const DepthsByTime& depths, TimePoint time) {
  const auto after = depths.lower_bound(time);
  if (after == depths.begin()) return after->second;
  const auto before = std::prev(after);
  if (after == depths.end()) return before->second;
  const double share = ToSeconds(time - before->first) / ToSeconds(after->first - before->first);
  return before->second + share * (after->second - before->second);
}

}  // namespace

std::vector<MapMotion> FindMapMotions(const RunRecord& record, const std::vector<FinalPose>& poses,
                                      const Engine& engine) {
  const Atlas& atlas = engine.atlas();
  std::map<MapId, DepthsByTime> depths;
  atlas.keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) {
    if (keyframe.session != atlas.session()) return;
    if (const auto depth = SceneDepthOf(keyframe, atlas)) {
      depths[atlas.map(keyframe.map).id][keyframe.timestamp] = *depth;
    }
  });
  std::map<MapId, std::vector<MotionSample>> paths;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    if (!poses[i].is_localised) continue;
    const ResolvedPose& pose = poses[i].pose;
    const auto depths_of_map = depths.find(pose.map_id);
    if (depths_of_map == depths.end()) continue;
    const TimePoint time = record.frames()[i].result.timestamp;
    const SE3 map_from_cam = pose.cam_from_map.Inverse();
    paths[pose.map_id].push_back({ToSeconds(time - record.frames().front().result.timestamp), map_from_cam.translation,
                                  map_from_cam.rotation * Eigen::Vector3d::UnitZ(),
                                  DepthAt(depths_of_map->second, time)});
  }
  std::vector<MapMotion> motions;
  for (const auto& [map_id, path] : paths) motions.push_back({map_id, FindPeriodicMotion(path)});
  return motions;
}

}  // namespace haustra
