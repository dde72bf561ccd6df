#include "engine/io/map_export.h"

#include <unordered_map>

namespace haustra {
namespace {

Status BadKeyframe(const KeyframeExport& keyframe, const std::string& what) {
  return InvalidArgument("map export: keyframe " + std::to_string(keyframe.id) + " " + what);
}

Status BadPoint(const PointExport& point, const std::string& what) {
  return InvalidArgument("map export: point " + std::to_string(point.id) + " " + what);
}

Status ValidateKeyframe(const KeyframeExport& keyframe) {
  if (keyframe.id < 0) return BadKeyframe(keyframe, "has a negative id");
  if (keyframe.image_name.empty()) return BadKeyframe(keyframe, "has no image name");
  if (keyframe.image_name.find_first_of(" \t\r\n") != std::string::npos) {
    return BadKeyframe(keyframe, "has a blank in its image name '" + keyframe.image_name + "'");
  }
  if (!keyframe.cam_from_map.translation.allFinite() || !keyframe.cam_from_map.rotation.coeffs().allFinite()) {
    return BadKeyframe(keyframe, "has a pose that is not finite");
  }
  if (keyframe.point_ids.size() != keyframe.keypoints.size()) {
    return BadKeyframe(keyframe, "has " + std::to_string(keyframe.keypoints.size()) + " keypoints but " +
                                     std::to_string(keyframe.point_ids.size()) + " point ids");
  }
  return Status::Ok();
}

}  // namespace

Status Validate(const MapExport& map) {
  std::unordered_map<int, const KeyframeExport*> keyframes;
  std::size_t num_from_keyframes = 0;
  for (const KeyframeExport& keyframe : map.keyframes) {
    HAUSTRA_TRY(ValidateKeyframe(keyframe));
    if (!keyframes.emplace(keyframe.id, &keyframe).second) return BadKeyframe(keyframe, "is there twice");
    for (const int id : keyframe.point_ids) num_from_keyframes += id >= 0 ? 1 : 0;
  }

  std::unordered_map<int, const PointExport*> points;
  std::size_t num_from_points = 0;
  for (const PointExport& point : map.points) {
    if (point.id < 0) return BadPoint(point, "has a negative id");
    if (!point.position.allFinite()) return BadPoint(point, "has a position that is not finite");
    if (!points.emplace(point.id, &point).second) return BadPoint(point, "is there twice");
    for (const auto& [keyframe_id, keypoint_idx] : point.track) {
      const auto found = keyframes.find(keyframe_id);
      if (found == keyframes.end()) {
        return BadPoint(point, "is seen by keyframe " + std::to_string(keyframe_id) + ", which is not in the map");
      }
      const std::vector<int>& point_ids = found->second->point_ids;
      if (keypoint_idx < 0 || keypoint_idx >= static_cast<int>(point_ids.size()) ||
          point_ids[keypoint_idx] != point.id) {
        return BadPoint(point, "is seen by keypoint " + std::to_string(keypoint_idx) + " of keyframe " +
                                   std::to_string(keyframe_id) + ", which says otherwise");
      }
      ++num_from_points;
    }
  }
  // Every track entry has its keypoint; with equal numbers and no entry twice every keypoint has its track entry too.
  if (num_from_points != num_from_keyframes) {
    return InvalidArgument("map export: the keypoints show points " + std::to_string(num_from_keyframes) +
                           " times, the tracks have " + std::to_string(num_from_points) + " entries");
  }
  return Status::Ok();
}

}  // namespace haustra
