#include "engine/export_map.h"

#include <algorithm>

#include "hal/frame_source.h"

namespace haustra {

MapExport ExportMap(const Engine& engine, MapHandle map_handle,
                    const std::function<std::string(std::uint32_t)>& image_name, const PointColour& colour) {
  const Atlas& atlas = engine.atlas();
  const Map& map = atlas.map(map_handle);
  MapExport out;
  out.map_id = static_cast<int>(map.id);
  out.calibration = engine.camera().calibration();
  for (const KeyframeHandle handle : map.keyframes) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    KeyframeExport entry;
    entry.id = static_cast<int>(keyframe.id);
    entry.timestamp_ns = keyframe.timestamp.time_since_epoch().count();
    entry.image_name = keyframe.session == atlas.session() ? image_name(keyframe.frame_index)
                                                           : "session_" + std::to_string(keyframe.session) + "/" +
                                                                 NumberedFrameName(keyframe.frame_index);
    entry.cam_from_map = keyframe.cam_from_map;
    for (int i = 0; i < keyframe.features.num; ++i) {
      entry.keypoints.push_back(keyframe.features.pixel(i).cast<float>());
      entry.point_ids.push_back(keyframe.points[i] ? static_cast<int>(atlas.point(keyframe.points[i]).id) : -1);
    }
    out.keyframes.push_back(std::move(entry));
  }
  atlas.points().ForEach([&](MapPointHandle, const MapPoint& point) {
    if (point.map != map_handle) return;
    PointExport entry;
    entry.id = static_cast<int>(point.id);
    entry.position = point.position;
    const Keyframe* newest = nullptr;
    int newest_feature = 0;
    double error = 0.0;
    for (const Observation& observation : point.observations) {
      const Keyframe& keyframe = atlas.keyframe(observation.keyframe);
      if (keyframe.session == atlas.session() && (newest == nullptr || keyframe.id > newest->id)) {
        newest = &keyframe;
        newest_feature = observation.feature_idx;
      }
      Eigen::Vector2d pixel;
      if (engine.camera().Project(keyframe.cam_from_map * point.position, &pixel)) {
        error += (pixel - keyframe.features.pixel(observation.feature_idx)).norm();
      }
      entry.track.emplace_back(static_cast<int>(keyframe.id), observation.feature_idx);
    }
    entry.reprojection_error_px = error / static_cast<double>(point.observations.size());
    std::sort(entry.track.begin(), entry.track.end());
    if (colour && newest != nullptr) entry.rgb = colour(newest->frame_index, newest->features.pixel(newest_feature));
    out.points.push_back(std::move(entry));
  });
  std::sort(out.points.begin(), out.points.end(),
            [](const PointExport& a, const PointExport& b) { return a.id < b.id; });
  return out;
}

}  // namespace haustra
