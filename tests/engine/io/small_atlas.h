// An atlas with a little of everything that an atlas file holds (maps, merged and dropped ones, culled keyframes,
// points with and without a normal), small enough to try every byte of its file.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/io/atlas_reader.h"
#include "engine/io/atlas_writer.h"
#include "engine/io/byte_order.h"
#include "engine/io/chunk_file.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {

inline std::vector<std::uint8_t> BytesOf(const std::string& text) { return {text.begin(), text.end()}; }

// Atlas and device of one process.
struct AtlasHome {
  static constexpr int kFeatures = 6;
  static constexpr Atlas::Capacity kRoomy{16, 64, 8, 64, kFeatures, 4};

  explicit AtlasHome(const Atlas::Capacity& capacity = kRoomy, int num_feature_sets = 16)
      : camera(CameraModel::Create(ColonCalibration()).value()),
        device(Plan(capacity.max_features, num_feature_sets), {}),
        atlas(capacity) {}

  static VisionPlan Plan(int max_features, int num_feature_sets) {
    VisionPlan plan;
    plan.max_width_px = 720;
    plan.max_height_px = 540;
    plan.max_features = max_features;
    plan.max_feature_sets = num_feature_sets;
    return plan;
  }

  std::string Save() {
    StringSink sink;
    const Status status = WriteAtlas(atlas, camera.calibration(), false, device, sink);
    EXPECT_TRUE(status.ok()) << status.ToString();
    return sink.bytes();
  }
  Status Load(std::span<const std::uint8_t> file, std::vector<KeyframeHandle>* keyframes = nullptr) {
    HAUSTRA_ASSIGN(const SavedAtlas saved, ReadAtlas(file));
    return RestoreAtlas(saved, camera, false, device, &atlas, keyframes);
  }

  KeyframeHandle AddKeyframe(MapHandle map, std::uint32_t frame_index, const SE3& cam_from_map) {
    std::vector<Keypoint> keypoints(kFeatures);
    std::vector<std::uint8_t> descriptors;
    FrameFeatures features(kFeatures);
    for (int i = 0; i < kFeatures; ++i) {
      const auto u = static_cast<float>(i);
      const auto f = static_cast<float>(frame_index);
      keypoints[i] = {100.25f + 50.0f * u + f, 80.5f + 60.0f * u, 2.0f + u, 0.5f * u, 0.01f * (u + 1.0f), i - 1};
      const auto bytes = EncodeAppearance({frame_index * 16 + static_cast<std::uint32_t>(i), 7});
      descriptors.insert(descriptors.end(), bytes.begin(), bytes.end());
      features.keypoints[i] = keypoints[i];
      Eigen::Vector3d bearing;
      EXPECT_TRUE(camera.Unproject(features.pixel(i), &bearing));
      features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                              static_cast<float>(bearing.z())};
    }
    features.num = kFeatures;
    features.set = device.CreateFeatureSet().value();
    EXPECT_TRUE(device.WriteFeatures(features.set, keypoints, descriptors).ok());
    return atlas.AddKeyframe(map, frame_index, TimePoint(std::chrono::milliseconds(40) * frame_index), cam_from_map,
                             features);
  }
  void Cull(KeyframeHandle keyframe, KeyframeHandle stand_in) {
    device.ReleaseFeatureSet(atlas.RemoveKeyframe(keyframe, stand_in));
  }
  MapPointHandle AddPoint(MapHandle map, const Eigen::Vector3d& position,
                          std::initializer_list<std::pair<KeyframeHandle, int>> views) {
    const MapPointHandle point = atlas.AddPoint(map, position, atlas.keyframe(views.begin()->first).id);
    for (const auto& [keyframe, feature] : views) EXPECT_TRUE(atlas.AddObservation(point, keyframe, feature));
    atlas.UpdatePoint(point);
    return point;
  }

  // Two stored maps of three and two keyframes; a merged and a dropped one; two culled keyframes, one of which stands
  // in for the other, and one whose map is gone.
  void FillSmall() {
    const auto at = [](double z, double turn) { return SE3(ExpSO3({0.0, turn, 0.0}), Eigen::Vector3d(0.1, -0.2, -z)); };
    const MapHandle first = atlas.CreateMap();
    const KeyframeHandle a = AddKeyframe(first, 3, at(0.0, 0.0));
    const KeyframeHandle b = AddKeyframe(first, 7, at(0.3, 0.1));
    const KeyframeHandle culled = AddKeyframe(first, 9, at(0.4, 0.1));
    const KeyframeHandle also_culled = AddKeyframe(first, 11, at(0.5, 0.2));
    AddPoint(first, {0.1, 0.2, 3.0}, {{a, 0}, {b, 1}, {culled, 2}});
    AddPoint(first, {0.3, -0.2, 2.5}, {{a, 1}, {b, 2}});
    const MapHandle dropped = atlas.CreateMap();
    AddKeyframe(dropped, 14, at(9.0, 0.0));
    std::vector<FeatureSetHandle> released;
    atlas.DropMap(dropped, &released);
    for (const FeatureSetHandle set : released) device.ReleaseFeatureSet(set);
    const MapHandle merged = atlas.CreateMap();
    const KeyframeHandle c = AddKeyframe(merged, 20, at(0.0, 0.0));
    atlas.TransformMap(merged, Sim3(1.5, ExpSO3({0.0, 0.3, 0.1}), {0.5, 0.0, 0.25}));
    atlas.AbsorbMap(first, merged);
    AddPoint(first, {0.4, 0.1, 3.5}, {{c, 0}, {a, 5}});
    Cull(also_culled, culled);
    Cull(culled, b);
    const MapHandle second = atlas.CreateMap();
    const KeyframeHandle d = AddKeyframe(second, 31, at(0.0, 0.0));
    const KeyframeHandle e = AddKeyframe(second, 36, at(0.3, -0.1));
    AddPoint(second, {-0.5, 0.25, 4.0}, {{d, 4}, {e, 3}});
    atlas.point(AddPoint(second, {-0.25, 0.5, 4.0}, {{d, 0}, {e, 0}})).normal.setZero();
  }

  MarkHandle AddMark(std::string_view label, KeyframeHandle keyframe, const Eigen::Vector3d& position) {
    Mark mark;
    mark.label = MarkLabel::From(label).value();
    mark.frame_index = 8;
    mark.timestamp = TimePoint(std::chrono::milliseconds(320));
    return atlas.AddMark(mark, keyframe, {atlas.keyframe(keyframe).map, position, {0.0, 0.6, -0.8}, 0.125});
  }
  // FillSmall with a mark in each map, and one that was removed.
  void FillMarked() {
    FillSmall();
    AddMark("removed", atlas.FindById(0), {0.1, 0.2, 3.0});
    AddMark("polyp-1", atlas.FindById(1), {0.1, 0.2, 3.0});
    AddMark("a", atlas.FindById(6), {-0.5, 0.25, 4.0});
    atlas.RemoveMark(atlas.FindMark("removed"));
  }

  CameraModel camera;
  ScriptedVisionDevice device;
  Atlas atlas;
};

// Each section of a file with its header.
inline std::vector<std::string> SplitSections(const std::string& file) {
  std::vector<std::string> sections = {file.substr(0, kChunkFileHeaderBytes)};
  for (std::size_t next = kChunkFileHeaderBytes; next < file.size();) {
    const std::vector<std::uint8_t> header = BytesOf(file.substr(next, kChunkHeaderBytes));
    const std::size_t size = kChunkHeaderBytes + ByteReader(std::span(header).subspan(8)).U64();
    sections.push_back(file.substr(next, size));
    next += size;
  }
  return sections;
}

}  // namespace haustra::test
