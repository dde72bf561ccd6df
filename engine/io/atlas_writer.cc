#include "engine/io/atlas_writer.h"

#include <algorithm>
#include <map>
#include <string>

#include "engine/io/atlas_format.h"
#include "engine/io/byte_order.h"
#include "engine/io/saved_atlas.h"

namespace haustra {
namespace {

// All but the descriptors. `handles`: of the keyframes, in the same order.
SavedAtlas Describe(const Atlas& atlas, std::vector<KeyframeHandle>* handles) {
  SavedAtlas saved;
  saved.counters = atlas.counters();
  saved.counters.session = 0;
  std::map<MapHandle, std::uint32_t> map_idx;
  std::vector<std::pair<MapId, MapHandle>> maps;
  atlas.maps().ForEach([&](MapHandle handle, const Map& map) {
    if (!map.keyframes.empty()) maps.emplace_back(map.id, handle);
  });
  std::sort(maps.begin(), maps.end());
  for (const auto& [id, handle] : maps) {
    map_idx[handle] = static_cast<std::uint32_t>(saved.maps.size());
    saved.maps.push_back({id, 0});
  }

  // In a sound atlas every map that is referred to holds keyframes; CheckSavedAtlas says so of any other.
  const auto idx_of = [&](MapHandle handle) {
    const auto at = map_idx.find(handle);
    return at == map_idx.end() ? kNoId : at->second;
  };
  std::vector<std::pair<KeyframeId, KeyframeHandle>> keyframes;
  atlas.keyframes().ForEach([&](KeyframeHandle handle, const Keyframe& k) { keyframes.emplace_back(k.id, handle); });
  std::sort(keyframes.begin(), keyframes.end());
  std::vector<std::uint32_t> keyframe_idx(atlas.keyframes().capacity(), 0);  // by slot
  std::map<FeatureSetHandle, std::uint32_t> keyframe_of_set;
  for (const auto& [id, handle] : keyframes) {
    const Keyframe& keyframe = atlas.keyframe(handle);
    keyframe_idx[handle.index] = static_cast<std::uint32_t>(saved.keyframes.size());
    keyframe_of_set[keyframe.features.set] = static_cast<std::uint32_t>(saved.keyframes.size());
    handles->push_back(handle);
    SavedKeyframe out;
    out.id = id;
    out.session = keyframe.session;
    out.frame_index = keyframe.frame_index;
    out.timestamp = keyframe.timestamp;
    out.map_idx = idx_of(keyframe.map);
    out.cam_from_map = keyframe.cam_from_map;
    out.scale = atlas.KeyframeScale(handle);
    out.keypoints = std::span(keyframe.features.keypoints).first(static_cast<std::size_t>(keyframe.features.num));
    saved.counters.session = std::max(saved.counters.session, keyframe.session + 1);
    saved.keyframes.push_back(out);
  }

  atlas.points().ForEach([&](MapPointHandle, const MapPoint& point) {
    SavedPoint out;
    out.id = point.id;
    out.map_idx = idx_of(point.map);
    out.position = point.position;
    out.normal = point.normal;
    out.scale_times_distance = point.scale_times_distance;
    out.first_keyframe_id = point.first_keyframe_id;
    for (const Observation& observation : point.observations) {
      HAUSTRA_CHECK(out.observations.PushBack({keyframe_idx[observation.keyframe.index], observation.feature_idx}));
    }
    if (const auto at = keyframe_of_set.find(point.descriptor.set); at != keyframe_of_set.end()) {
      out.descriptor = {at->second, point.descriptor.feature_idx};
    } else if (!out.observations.empty()) {
      out.descriptor = out.observations[0];
    }
    saved.points.push_back(out);
  });
  std::sort(saved.points.begin(), saved.points.end(), [](const auto& a, const auto& b) { return a.id < b.id; });

  for (KeyframeId id = 0; id < atlas.num_keyframe_ids(); ++id) {
    const KeyframeHandle stand_in = atlas.FindById(id);
    if (!stand_in || atlas.keyframe(stand_in).id == id) continue;
    const KeyframeTrace& trace = atlas.TraceOfKeyframe(id);
    saved.traces.push_back({id, trace.session, trace.frame_index, trace.stand_in, trace.cam_from_stand_in,
                            trace.stand_in_scale, trace.scale, 0});
    saved.counters.session = std::max(saved.counters.session, trace.session + 1);
  }
  atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    SavedMark out;
    out.id = mark.id;
    out.label = mark.label;
    out.session = mark.session;
    out.frame_index = mark.frame_index;
    out.timestamp = mark.timestamp;
    out.keyframe_idx = atlas.GetKeyframe(mark.keyframe) == nullptr ? kNoId : keyframe_idx[mark.keyframe.index];
    out.point_in_anchor = mark.point_in_anchor;
    out.normal_in_anchor = mark.normal_in_anchor;
    out.radius = mark.radius;
    out.scale = mark.scale;
    saved.marks.push_back(out);
    saved.counters.session = std::max(saved.counters.session, mark.session + 1);
  });
  std::sort(saved.marks.begin(), saved.marks.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return saved;
}

std::string EncodeIdentity(const SavedAtlas& atlas) {
  std::string bytes;
  ByteWriter writer(&bytes);
  const CameraCalibration& camera = atlas.camera;
  writer.U32(static_cast<std::uint32_t>(camera.kind));
  writer.I32(camera.width_px);
  writer.I32(camera.height_px);
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) writer.F64(value);
  for (const double value : camera.coefficients) writer.F64(value);
  writer.F64(camera.rate_hz);
  writer.F64(camera.max_half_angle_deg);
  writer.U32(kDescriptorBytes);
  writer.U32(atlas.root_sift ? 1 : 0);
  return bytes;
}

std::string EncodeContents(const SavedAtlas& atlas) {
  std::string bytes;
  ByteWriter writer(&bytes);
  writer.U32(atlas.counters.next_keyframe_id);
  writer.U32(atlas.counters.next_point_id);
  writer.U32(atlas.counters.next_map_id);
  writer.U32(atlas.counters.session);
  for (const std::size_t size : {atlas.maps.size(), atlas.keyframes.size(), atlas.points.size(), atlas.traces.size()}) {
    writer.U32(static_cast<std::uint32_t>(size));
  }
  return bytes;
}

// Without the descriptors.
void EncodeKeyframe(const SavedKeyframe& keyframe, std::string* bytes) {
  ByteWriter writer(bytes);
  writer.U32(keyframe.id);
  writer.U32(keyframe.session);
  writer.U32(keyframe.frame_index);
  writer.I64(keyframe.timestamp.time_since_epoch().count());
  writer.U32(keyframe.map_idx);
  writer.Pose(keyframe.cam_from_map);
  writer.F64(keyframe.scale);
  writer.U32(static_cast<std::uint32_t>(keyframe.keypoints.size()));
  for (const Keypoint& keypoint : keyframe.keypoints) {
    for (const float value : {keypoint.x_px, keypoint.y_px, keypoint.scale_px, keypoint.angle_rad, keypoint.response}) {
      writer.F32(value);
    }
    writer.I32(keypoint.octave);
  }
}

void EncodePoint(const SavedPoint& point, std::string* bytes) {
  ByteWriter writer(bytes);
  writer.U32(point.id);
  writer.U32(point.map_idx);
  writer.Vector(point.position);
  writer.Vector(point.normal);
  writer.F64(point.scale_times_distance);
  writer.U32(point.first_keyframe_id);
  writer.U32(point.descriptor.keyframe_idx);
  writer.I32(point.descriptor.feature_idx);
  writer.U32(static_cast<std::uint32_t>(point.observations.size()));
  for (const SavedObservation& observation : point.observations) {
    writer.U32(observation.keyframe_idx);
    writer.I32(observation.feature_idx);
  }
}

void EncodeTrace(const SavedTrace& trace, std::string* bytes) {
  ByteWriter writer(bytes);
  for (const std::uint32_t value : {trace.id, trace.session, trace.frame_index, trace.stand_in}) writer.U32(value);
  writer.Pose(trace.cam_from_stand_in);
  writer.F64(trace.stand_in_scale);
  writer.F64(trace.scale);
}

void EncodeMark(const SavedMark& mark, std::string* bytes) {
  ByteWriter writer(bytes);
  writer.U32(mark.id);
  bytes->append(mark.label.bytes().begin(), mark.label.bytes().end());
  writer.U32(mark.session);
  writer.U32(mark.frame_index);
  writer.I64(mark.timestamp.time_since_epoch().count());
  writer.U32(mark.keyframe_idx);
  writer.Vector(mark.point_in_anchor);
  writer.Vector(mark.normal_in_anchor);
  writer.F64(mark.radius);
  writer.F64(mark.scale);
}

}  // namespace

Status WriteAtlas(const Atlas& atlas, const CameraCalibration& camera, bool root_sift, VisionDevice& device,
                  ByteSink& sink) {
  std::vector<KeyframeHandle> handles;
  SavedAtlas saved = Describe(atlas, &handles);
  saved.camera = camera;
  saved.root_sift = root_sift;
  if (const Status status = CheckSavedAtlas(saved); !status.ok()) {
    return Internal("the atlas cannot be saved: " + status.message());
  }
  ChunkWriter writer(kAtlasFileKind, sink);
  HAUSTRA_TRY(writer.Begin());
  HAUSTRA_TRY(writer.Write(kIdentityTag, EncodeIdentity(saved)));
  HAUSTRA_TRY(writer.Write(kContentsTag, EncodeContents(saved)));
  std::string bytes;
  for (const SavedMap& map : saved.maps) ByteWriter(&bytes).U32(map.id);
  HAUSTRA_TRY(writer.Write(kMapsTag, bytes));
  std::vector<std::uint8_t> descriptors;
  for (std::size_t i = 0; i < saved.keyframes.size(); ++i) {
    descriptors.resize(saved.keyframes[i].keypoints.size() * kDescriptorBytes);
    HAUSTRA_TRY(device.ReadDescriptors(atlas.keyframe(handles[i]).features.set, descriptors));
    bytes.clear();
    EncodeKeyframe(saved.keyframes[i], &bytes);
    bytes.append(descriptors.begin(), descriptors.end());
    HAUSTRA_TRY(writer.Write(kKeyframeTag, bytes));
  }
  for (std::size_t first = 0; first < saved.points.size(); first += kPointsPerSection) {
    bytes.clear();
    for (std::size_t i = first; i < std::min(first + kPointsPerSection, saved.points.size()); ++i) {
      EncodePoint(saved.points[i], &bytes);
    }
    HAUSTRA_TRY(writer.Write(kPointsTag, bytes));
  }
  bytes.clear();
  for (const SavedTrace& trace : saved.traces) EncodeTrace(trace, &bytes);
  HAUSTRA_TRY(writer.Write(kTracesTag, bytes));
  if (saved.counters.next_mark_id > 0) {
    bytes.clear();
    ByteWriter(&bytes).U32(saved.counters.next_mark_id);
    for (const SavedMark& mark : saved.marks) EncodeMark(mark, &bytes);
    HAUSTRA_TRY(writer.Write(kMarksTag, bytes));
  }
  return writer.End();
}

}  // namespace haustra
