// The contents of an atlas as plain data, as they go into a file and come out of it (format: atlas_format.h). Entities
// refer to each other by position in these lists, which are in order of the ids, so that equal contents give equal
// bytes whatever slots of the pools they lie in.
//
// Kept: all maps that hold keyframes, with keyframes, features, points and observations; for every keyframe that was
// culled, who stands in for it, so that frames tracked against it keep their final poses; the marks of a doctor; the
// counters of all ids.
// Not kept, because they follow from the observations: covisibility, the essential graph, the windows of local maps.
// Not kept, because nothing refers to them any more: maps that were merged into others or dropped.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/atlas/atlas.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

// `offset` in each: where it lies in its file, for messages; 0 when it does not come from one.
struct SavedMap {
  MapId id = 0;
  std::uint64_t offset = 0;
};

struct SavedKeyframe {
  KeyframeId id = 0;
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  std::uint32_t map_idx = 0;
  SE3 cam_from_map;
  double scale = 1.0;                         // KeyframeTrace::scale
  std::span<const Keypoint> keypoints;        // of the atlas, or in SavedAtlas::keypoints
  std::span<const std::uint8_t> descriptors;  // N x 128 u8 in the file's bytes; empty: still on the vision device
  std::uint64_t offset = 0;
};

struct SavedObservation {
  std::uint32_t keyframe_idx = 0;
  std::int32_t feature_idx = 0;
};

struct SavedPoint {
  std::uint32_t id = 0;
  std::uint32_t map_idx = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double scale_times_distance = 0.0;
  KeyframeId first_keyframe_id = 0;
  SavedObservation descriptor;
  FixedVector<SavedObservation, kMaxObservations> observations;
  std::uint64_t offset = 0;
};

// Of a keyframe that was culled; KeyframeTrace.
struct SavedTrace {
  KeyframeId id = 0;
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  KeyframeId stand_in = 0;
  SE3 cam_from_stand_in;
  double stand_in_scale = 1.0;
  double scale = 1.0;
  std::uint64_t offset = 0;
};

// Mark, without the handle of its keyframe.
struct SavedMark {
  MarkId id = 0;
  MarkLabel label;
  std::uint32_t session = 0;
  std::uint32_t frame_index = 0;
  TimePoint timestamp;
  std::uint32_t keyframe_idx = 0;
  Eigen::Vector3d point_in_anchor = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal_in_anchor = Eigen::Vector3d::Zero();
  double radius = 0.0;
  double scale = 1.0;
  std::uint64_t offset = 0;
};

struct SavedAtlas {
  CameraCalibration camera;
  bool root_sift = false;    // descriptors of the two kinds do not compare
  Atlas::Counters counters;  // session: of the next run
  std::vector<SavedMap> maps;
  std::vector<SavedKeyframe> keyframes;
  std::vector<SavedPoint> points;
  std::vector<SavedTrace> traces;
  std::vector<SavedMark> marks;
  std::vector<std::vector<Keypoint>> keypoints;  // what the keyframes of a file refer to

  int max_features() const;
};

// Whether an atlas can be made of it: numbers finite and in range, ids unique and below their counters, both ends of
// every reference there, chains of stand-ins that end. The camera must be one that CameraModel takes. kDataLoss names
// section, offset and entity of the first fault. Capacities are not looked at. O(n log n).
Status CheckSavedAtlas(const SavedAtlas& atlas);

// For a new run, of a checked atlas: the keyframes have the ids 0, 1, 2 in their order, and those that were culled are
// forgotten, as no frame of a new run refers to them. A point made by one of them counts as made by the next one.
void RenumberKeyframes(SavedAtlas* atlas);

// "atlas file, section 'KEYF' at byte 1234: " for a fault in it.
std::string AtlasFilePlace(std::string_view section, std::uint64_t offset);

}  // namespace haustra
