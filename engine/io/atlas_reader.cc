#include "engine/io/atlas_reader.h"

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <utility>

#include "engine/io/atlas_format.h"
#include "engine/io/byte_order.h"

namespace haustra {
namespace {

// Numbers given in all runs together; beyond it the 32 bits would run out in the next ones.
constexpr std::int64_t kMaxIds = std::int64_t{1} << 31;
constexpr std::size_t kKeypointBytes = 24;
constexpr std::size_t kFeatureBytes = kKeypointBytes + kDescriptorBytes;

// Sections in the order of the format, their bytes taken apart; what the numbers mean is CheckSavedAtlas' business.
class FileParser {
 public:
  explicit FileParser(std::span<const std::uint8_t> file) : reader_(kAtlasFileKind, file) {}

  Status Parse(SavedAtlas* atlas) {
    HAUSTRA_TRY(reader_.Begin());
    HAUSTRA_TRY(Advance());
    HAUSTRA_TRY(Expect(kIdentityTag));
    HAUSTRA_TRY(ParseIdentity(atlas));
    HAUSTRA_TRY(Expect(kContentsTag));
    HAUSTRA_TRY(ParseContents(atlas));
    HAUSTRA_TRY(Expect(kMapsTag));
    HAUSTRA_TRY(ParseMaps(atlas));
    while (chunk_.tag == kKeyframeTag) HAUSTRA_TRY(ParseKeyframe(atlas));
    while (chunk_.tag == kPointsTag) HAUSTRA_TRY(ParsePoints(atlas));
    HAUSTRA_TRY(Expect(kTracesTag));
    HAUSTRA_TRY(ParseTraces(atlas));
    if (chunk_.tag == kMarksTag) HAUSTRA_TRY(ParseMarks(atlas));
    HAUSTRA_TRY(Expect(kEndTag));
    return CheckCounts(*atlas);
  }

 private:
  Status Advance() {
    HAUSTRA_ASSIGN(chunk_, reader_.Next());
    return Status::Ok();
  }

  Status Bad(std::uint64_t offset, const std::string& what) const {
    return DataLoss(AtlasFilePlace(chunk_.tag, offset) + what);
  }

  Status Expect(std::string_view tag) const {
    if (chunk_.tag == tag) return Status::Ok();
    return Bad(chunk_.offset, "section '" + std::string(tag) + "' expected here");
  }

  // The section must have been used up to the byte.
  Status Finish(const ByteReader& reader) {
    if (reader.is_short()) return Bad(reader.offset(), "the section ends within an entry");
    if (reader.num_left() != 0) return Bad(reader.offset(), std::to_string(reader.num_left()) + " bytes too many");
    return Advance();
  }

  Status ParseIdentity(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    CameraCalibration& camera = atlas->camera;
    const std::uint32_t kind = reader.U32();
    if (kind > static_cast<std::uint32_t>(CameraModelKind::kOcamCalib)) {
      return Bad(chunk_.offset, "camera model " + std::to_string(kind) + " is not known");
    }
    camera.kind = static_cast<CameraModelKind>(kind);
    camera.width_px = reader.I32();
    camera.height_px = reader.I32();
    for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = reader.F64();
    for (double& value : camera.coefficients) value = reader.F64();
    camera.rate_hz = reader.F64();
    camera.max_half_angle_deg = reader.F64();
    const std::uint64_t offset = reader.offset();
    const std::uint32_t descriptor_bytes = reader.U32();
    const std::uint32_t root_sift = reader.U32();
    if (descriptor_bytes != kDescriptorBytes || root_sift > 1) {
      return Bad(offset, "descriptors of " + std::to_string(descriptor_bytes) + " bytes, kind " +
                             std::to_string(root_sift) + " are not known");
    }
    atlas->root_sift = root_sift == 1;
    return Finish(reader);
  }

  Status ParseContents(SavedAtlas* atlas) {
    contents_offset_ = chunk_.offset;
    ByteReader reader(chunk_.payload, chunk_.offset);
    Atlas::Counters& counters = atlas->counters;
    for (std::uint32_t* value :
         {&counters.next_keyframe_id, &counters.next_point_id, &counters.next_map_id, &counters.session}) {
      *value = reader.U32();
    }
    for (std::uint32_t& count : counts_) count = reader.U32();
    return Finish(reader);
  }

  Status ParseMaps(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    while (reader.num_left() >= 4) {
      const std::uint64_t offset = reader.offset();
      atlas->maps.push_back({reader.U32(), offset});
    }
    return Finish(reader);
  }

  Status ParseKeyframe(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    SavedKeyframe keyframe;
    keyframe.offset = chunk_.offset;
    keyframe.id = reader.U32();
    keyframe.session = reader.U32();
    keyframe.frame_index = reader.U32();
    keyframe.timestamp = TimePoint(Duration(reader.I64()));
    keyframe.map_idx = reader.U32();
    keyframe.cam_from_map = reader.Pose();
    keyframe.scale = reader.F64();
    const std::size_t num_features = reader.U32();
    if (reader.is_short() || num_features * kFeatureBytes != reader.num_left()) {
      return Bad(reader.offset(), std::to_string(num_features) + " features do not fill the section's " +
                                      std::to_string(reader.num_left()) + " bytes");
    }
    std::vector<Keypoint>& keypoints = atlas->keypoints.emplace_back(num_features);
    for (Keypoint& keypoint : keypoints) {
      for (float* value :
           {&keypoint.x_px, &keypoint.y_px, &keypoint.scale_px, &keypoint.angle_rad, &keypoint.response}) {
        *value = reader.F32();
      }
      keypoint.octave = reader.I32();
    }
    keyframe.keypoints = keypoints;
    keyframe.descriptors = reader.Bytes(num_features * kDescriptorBytes);
    atlas->keyframes.push_back(keyframe);
    return Finish(reader);
  }

  Status ParsePoints(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    while (reader.num_left() > 0) {
      SavedPoint point;
      point.offset = reader.offset();
      point.id = reader.U32();
      point.map_idx = reader.U32();
      point.position = reader.Vector();
      point.normal = reader.Vector();
      point.scale_times_distance = reader.F64();
      point.first_keyframe_id = reader.U32();
      point.descriptor.keyframe_idx = reader.U32();
      point.descriptor.feature_idx = reader.I32();
      const std::uint32_t num_observations = reader.U32();
      if (num_observations > kMaxObservations) {
        return Bad(point.offset, "point " + std::to_string(point.id) + ": " + std::to_string(num_observations) +
                                     " observations, " + std::to_string(kMaxObservations) + " are the most");
      }
      for (std::uint32_t i = 0; i < num_observations; ++i) {
        SavedObservation observation;
        observation.keyframe_idx = reader.U32();
        observation.feature_idx = reader.I32();
        (void)point.observations.PushBack(observation);  // there is room, see above
      }
      if (reader.is_short()) break;
      atlas->points.push_back(point);
    }
    return Finish(reader);
  }

  Status ParseTraces(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    while (reader.num_left() > 0) {
      SavedTrace trace;
      trace.offset = reader.offset();
      for (std::uint32_t* value : {&trace.id, &trace.session, &trace.frame_index, &trace.stand_in}) {
        *value = reader.U32();
      }
      trace.cam_from_stand_in = reader.Pose();
      trace.stand_in_scale = reader.F64();
      trace.scale = reader.F64();
      if (reader.is_short()) break;
      atlas->traces.push_back(trace);
    }
    return Finish(reader);
  }

  Status ParseMarks(SavedAtlas* atlas) {
    ByteReader reader(chunk_.payload, chunk_.offset);
    atlas->counters.next_mark_id = reader.U32();
    while (reader.num_left() > 0) {
      SavedMark mark;
      mark.offset = reader.offset();
      mark.id = reader.U32();
      const std::span<const std::uint8_t> label = reader.Bytes(kMaxMarkLabelBytes + 1);
      mark.session = reader.U32();
      mark.frame_index = reader.U32();
      mark.timestamp = TimePoint(Duration(reader.I64()));
      mark.keyframe_idx = reader.U32();
      mark.point_in_anchor = reader.Vector();
      mark.normal_in_anchor = reader.Vector();
      mark.radius = reader.F64();
      mark.scale = reader.F64();
      if (reader.is_short()) break;
      const auto end = std::find(label.begin(), label.end(), 0);
      const auto text = MarkLabel::From(std::string(label.begin(), end));
      const bool is_filled = std::all_of(end, label.end(), [](std::uint8_t byte) { return byte == 0; });
      if (!text || !is_filled) return Bad(mark.offset, "mark " + std::to_string(mark.id) + ": its label is none");
      mark.label = *text;
      atlas->marks.push_back(mark);
    }
    return Finish(reader);
  }

  Status CheckCounts(const SavedAtlas& atlas) const {
    const std::pair<const char*, std::size_t> lists[] = {{"maps", atlas.maps.size()},
                                                         {"keyframes", atlas.keyframes.size()},
                                                         {"points", atlas.points.size()},
                                                         {"traces", atlas.traces.size()}};
    for (std::size_t i = 0; i < counts_.size(); ++i) {
      if (lists[i].second == counts_[i]) continue;
      return DataLoss(AtlasFilePlace(kContentsTag, contents_offset_) + std::to_string(counts_[i]) + " " +
                      lists[i].first + " announced, " + std::to_string(lists[i].second) + " found");
    }
    return Status::Ok();
  }

  ChunkReader reader_;
  Chunk chunk_;
  std::uint64_t contents_offset_ = 0;
  std::array<std::uint32_t, 4> counts_{};  // maps, keyframes, points, traces
};

std::string_view NameOf(CameraModelKind kind) {
  switch (kind) {
    case CameraModelKind::kPinhole: return "pinhole";
    case CameraModelKind::kKannalaBrandt: return "Kannala-Brandt";
    case CameraModelKind::kOcamCalib: return "OCamCalib";
  }
  return "unknown";
}

// Poses and points hold for one camera only, so every number must be the same. The frame rate has no part in them.
Status CheckCamera(const CameraCalibration& saved, const CameraCalibration& ours) {
  const auto other = [](const std::string& what, const std::string& a, const std::string& b) {
    return FailedPrecondition("the atlas was made with another camera: " + what + " is " + a + " there and " + b +
                              " here");
  };
  if (saved.kind != ours.kind) {
    return other("the model", std::string(NameOf(saved.kind)), std::string(NameOf(ours.kind)));
  }
  const auto size = [](const CameraCalibration& c) {
    return std::to_string(c.width_px) + "x" + std::to_string(c.height_px);
  };
  if (size(saved) != size(ours)) return other("the image", size(saved), size(ours));
  std::vector<std::tuple<std::string, double, double>> numbers = {
      {"fx", saved.fx, ours.fx},
      {"fy", saved.fy, ours.fy},
      {"cx", saved.cx, ours.cx},
      {"cy", saved.cy, ours.cy},
      {"max_half_angle_deg", saved.max_half_angle_deg, ours.max_half_angle_deg}};
  for (std::size_t i = 0; i < saved.coefficients.size(); ++i) {
    numbers.emplace_back("coefficient " + std::to_string(i + 1), saved.coefficients[i], ours.coefficients[i]);
  }
  for (const auto& [name, a, b] : numbers) {
    if (a != b) return other(name, std::to_string(a), std::to_string(b));
  }
  return Status::Ok();
}

Status CheckCapacity(const SavedAtlas& saved, const VisionDevice& device, const Atlas& atlas) {
  const Atlas::Capacity capacity = atlas.capacity();
  struct Pool {
    const char* name;
    std::size_t needed;
    std::int64_t available;
  };
  const Pool pools[] = {
      {"keyframes (memory.max_keyframes)", saved.keyframes.size(), capacity.max_keyframes},
      {"map points (memory.max_map_points)", saved.points.size(), capacity.max_map_points},
      {"marks (memory.max_marks)", saved.marks.size(), capacity.max_marks},
      {"maps (memory.max_maps)", saved.maps.size(), capacity.max_maps},
      {"keyframe ids (memory.max_keyframe_ids)", saved.counters.next_keyframe_id, capacity.max_keyframe_ids},
      {"point ids", saved.counters.next_point_id, kMaxIds},
      {"map ids", saved.counters.next_map_id, kMaxIds},
      {"mark ids", saved.counters.next_mark_id, kMaxIds},
      {"sessions", saved.counters.session, kMaxIds},
      {"features of a keyframe (features.max)", static_cast<std::size_t>(saved.max_features()),
       std::min(capacity.max_features, device.plan().max_features)},
      {"feature sets of the vision device", saved.keyframes.size(), device.num_free_feature_sets()}};
  for (const Pool& pool : pools) {
    if (static_cast<std::int64_t>(pool.needed) <= pool.available) continue;
    return CapacityExceeded("the atlas does not fit: " + std::to_string(pool.needed) + " " + pool.name +
                            " needed, room for " + std::to_string(pool.available));
  }
  return Status::Ok();
}

// Sets on the device that go again unless they are kept.
class Uploads {
 public:
  explicit Uploads(VisionDevice& device) : device_(device) {}
  ~Uploads() {
    for (const FeatureSetHandle set : sets_) device_.ReleaseFeatureSet(set);
  }

  Status Add(const SavedKeyframe& keyframe) {
    HAUSTRA_ASSIGN(const FeatureSetHandle set, device_.CreateFeatureSet());
    sets_.push_back(set);
    return device_.WriteFeatures(set, keyframe.keypoints, keyframe.descriptors);
  }
  std::vector<FeatureSetHandle> Keep() { return std::exchange(sets_, {}); }

 private:
  VisionDevice& device_;
  std::vector<FeatureSetHandle> sets_;
};

}  // namespace

Result<SavedAtlas> ReadAtlas(std::span<const std::uint8_t> file) {
  SavedAtlas atlas;
  HAUSTRA_TRY(FileParser(file).Parse(&atlas));
  HAUSTRA_TRY(CheckSavedAtlas(atlas));
  return atlas;
}

Status RestoreAtlas(const SavedAtlas& saved, const CameraModel& camera, bool root_sift, VisionDevice& device,
                    Atlas* atlas, std::vector<KeyframeHandle>* keyframes) {
  const Atlas::Counters counters = atlas->counters();
  if (counters.next_keyframe_id != 0 || counters.next_point_id != 0 || counters.next_map_id != 0) {
    return FailedPrecondition("an atlas can be loaded only before the first map is made");
  }
  HAUSTRA_TRY(CheckCamera(saved.camera, camera.calibration()));
  if (saved.root_sift != root_sift) {
    return FailedPrecondition(std::string("the atlas has ") + (saved.root_sift ? "RootSIFT" : "SIFT") +
                              " descriptors, this configuration (features.root_sift) makes " +
                              (root_sift ? "RootSIFT" : "SIFT") + " ones");
  }
  HAUSTRA_TRY(CheckCapacity(saved, device, *atlas));
  Uploads uploads(device);
  for (const SavedKeyframe& keyframe : saved.keyframes) HAUSTRA_TRY(uploads.Add(keyframe));

  // From here on nothing can fail.
  const std::vector<FeatureSetHandle> sets = uploads.Keep();
  atlas->RestoreCounters(saved.counters);
  std::vector<MapHandle> maps;
  for (const SavedMap& map : saved.maps) maps.push_back(atlas->RestoreMap(map.id));
  FrameFeatures features(saved.max_features());
  std::vector<KeyframeHandle> handles;
  for (std::size_t i = 0; i < saved.keyframes.size(); ++i) {
    const SavedKeyframe& keyframe = saved.keyframes[i];
    features.set = sets[i];
    features.num = static_cast<std::int32_t>(keyframe.keypoints.size());
    std::copy(keyframe.keypoints.begin(), keyframe.keypoints.end(), features.keypoints.begin());
    for (int k = 0; k < features.num; ++k) {
      Eigen::Vector3d bearing;
      // As the tracker has it.
      if (!camera.Unproject(features.pixel(k), &bearing)) bearing.setZero();
      features.bearings[k] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                              static_cast<float>(bearing.z())};
    }
    handles.push_back(atlas->RestoreKeyframe(maps[keyframe.map_idx], keyframe.id, keyframe.session,
                                             keyframe.frame_index, keyframe.timestamp, keyframe.cam_from_map,
                                             keyframe.scale, features));
  }
  for (const SavedTrace& trace : saved.traces) {
    atlas->RestoreTrace(trace.id, {.session = trace.session,
                                   .frame_index = trace.frame_index,
                                   .keyframe = {},
                                   .stand_in = trace.stand_in,
                                   .cam_from_stand_in = trace.cam_from_stand_in,
                                   .stand_in_scale = trace.stand_in_scale,
                                   .scale = trace.scale});
  }
  for (const SavedPoint& point : saved.points) {
    const MapPointHandle handle =
        atlas->RestorePoint(maps[point.map_idx], point.id, point.position, point.first_keyframe_id);
    for (const SavedObservation& observation : point.observations) {
      HAUSTRA_CHECK(atlas->AddObservation(handle, handles[observation.keyframe_idx], observation.feature_idx));
    }
    MapPoint& restored = atlas->point(handle);
    restored.normal = point.normal;
    restored.scale_times_distance = point.scale_times_distance;
    restored.descriptor = {sets[point.descriptor.keyframe_idx], point.descriptor.feature_idx};
  }
  for (const SavedMark& mark : saved.marks) {
    atlas->RestoreMark({.id = mark.id,
                        .label = mark.label,
                        .session = mark.session,
                        .frame_index = mark.frame_index,
                        .timestamp = mark.timestamp,
                        .keyframe = handles[mark.keyframe_idx],
                        .point_in_anchor = mark.point_in_anchor,
                        .normal_in_anchor = mark.normal_in_anchor,
                        .radius = mark.radius,
                        .scale = mark.scale});
  }
  if (keyframes != nullptr) *keyframes = std::move(handles);
  return Status::Ok();
}

}  // namespace haustra
