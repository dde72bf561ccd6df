// A tube with landmarks on its wall, keyframes inside with what they see of it, and maps made of them with known truth:
// what place recognition and merging are tested on. The scripted vision device knows the landmarks by name.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <tuple>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/rng.h"
#include "engine/place/common_area.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {

struct Landmark {
  Eigen::Vector3d position;  // world, tube radius 1
  double size = 0.0;         // SIFT scale times distance
  ScriptedAppearance appearance;
};

class SyntheticColon {
 public:
  static constexpr int kMaxFeatures = 1000;

  explicit SyntheticColon(std::uint64_t seed, int max_keyframes = 300)
      : rng_(seed), camera_(CameraModel::Create(ColonCalibration()).value()), device_(Plan(max_keyframes + 20), {}) {
    config_.features.max = kMaxFeatures;
    config_.memory.max_keyframes = max_keyframes;
    config_.memory.max_map_points = std::max(40000, 80 * max_keyframes);
    config_.memory.max_maps = 8;
    config_.memory.max_keyframe_ids = std::max(1000, max_keyframes);
    config_.memory.max_local_points = 8000;
  }

  EngineConfig& config() { return config_; }
  const CameraModel& camera() const { return camera_; }
  const SceneRegion& scene() const { return scene_; }
  ScriptedVisionDevice& device() { return device_; }
  Rng& rng() { return rng_; }
  Atlas MakeAtlas() const {
    return Atlas({config_.memory.max_keyframes, config_.memory.max_map_points, config_.memory.max_maps,
                  config_.memory.max_keyframe_ids, kMaxFeatures, config_.memory.max_marks});
  }

  void AddLandmark(const Eigen::Vector3d& position) {
    const auto id = static_cast<std::uint32_t>(landmarks_.size()) + 1;
    landmarks_.push_back({position, rng_.Uniform(3.0, 8.0), {id, id}});
  }
  // Landmarks between z = begin and end. Returns the index of the first.
  int AddWall(double begin, double end, int num_landmarks) {
    const int first = static_cast<int>(landmarks_.size());
    for (int i = 0; i < num_landmarks; ++i) {
      const double around = rng_.Uniform(0.0, 2.0 * std::numbers::pi), z = rng_.Uniform(begin, end);
      const double radius = 1.0 + 0.15 * std::sin(4.0 * z) + 0.1 * std::cos(2.0 * around + z);
      AddLandmark({radius * std::cos(around), radius * std::sin(around), z});
    }
    return first;
  }
  // A copy of `count` landmarks from `first`, `offset` farther along, that looks the same but is another wall; the
  // landmarks are displaced by up to `jitter`. Not even the descriptors of an indistinguishable one differ.
  int AddTwin(int first, int count, double offset, double jitter, bool is_indistinguishable = false) {
    const int twin = static_cast<int>(landmarks_.size());
    for (int i = first; i < first + count; ++i) {
      Landmark landmark = landmarks_[i];
      landmark.position += Eigen::Vector3d(0, 0, offset) + rng_.Uniform(0.0, jitter) * RandomDirection(rng_);
      if (!is_indistinguishable) landmark.appearance.landmark_id = static_cast<std::uint32_t>(landmarks_.size()) + 1;
      landmarks_.push_back(landmark);
    }
    return twin;
  }

  // A copy of `count` landmarks from `first` that looks the same and is the same wall in another place.
  void AddMovedTwin(int first, int count, const SE3& twin_from_wall) {
    for (int i = first; i < first + count; ++i) {
      Landmark landmark = landmarks_[i];
      landmark.position = twin_from_wall * landmark.position;
      landmarks_.push_back(landmark);
    }
  }

  // A view along the tube from z, a little off the axis.
  SE3 ViewFrom(double z) {
    const SE3 wobble = RandomPose(rng_, 0.15, 0.0);
    const Eigen::Vector3d centre(rng_.Uniform(-0.15, 0.15), rng_.Uniform(-0.15, 0.15), z);
    return SE3(wobble.rotation, -(wobble.rotation * centre));
  }

  // What a camera sees, and of each feature the landmark. The feature set is the caller's.
  struct Sight {
    FrameFeatures features{kMaxFeatures};
    std::vector<int> landmarks;
  };
  Sight Look(const SE3& cam_from_world) {
    Sight sight;
    FrameFeatures& features = sight.features;
    std::vector<Keypoint> keypoints;
    std::vector<std::uint8_t> descriptors;
    for (std::size_t i = 0; i < landmarks_.size() && keypoints.size() < kMaxFeatures; ++i) {
      const Eigen::Vector3d in_cam = cam_from_world * landmarks_[i].position;
      Eigen::Vector2d pixel;
      if (in_cam.z() < 0.3 || in_cam.norm() > 3.0 || !camera_.Project(in_cam, &pixel)) continue;
      if (rng_.Uniform() > 0.7) continue;  // not detected
      pixel += 0.4 * Eigen::Vector2d(Gaussian(rng_), Gaussian(rng_));
      if (!camera_.IsInImage(pixel)) continue;
      Keypoint keypoint;
      keypoint.x_px = static_cast<float>(pixel.x());
      keypoint.y_px = static_cast<float>(pixel.y());
      keypoint.scale_px = static_cast<float>(landmarks_[i].size / in_cam.norm());
      keypoint.response = static_cast<float>(1.0 / (1.0 + static_cast<double>(i % 97)));
      keypoints.push_back(keypoint);
      const auto bytes = EncodeAppearance(landmarks_[i].appearance);
      descriptors.insert(descriptors.end(), bytes.begin(), bytes.end());
      sight.landmarks.push_back(static_cast<int>(i));
    }
    features.num = static_cast<std::int32_t>(keypoints.size());
    std::copy(keypoints.begin(), keypoints.end(), features.keypoints.begin());
    for (int i = 0; i < features.num; ++i) {
      Eigen::Vector3d bearing;
      EXPECT_TRUE(camera_.Unproject(features.pixel(i), &bearing));
      features.bearings[i] = {static_cast<float>(bearing.x()), static_cast<float>(bearing.y()),
                              static_cast<float>(bearing.z())};
    }
    features.set = device_.CreateFeatureSet().value();
    EXPECT_TRUE(device_.WriteFeatures(features.set, keypoints, descriptors).ok());
    return sight;
  }

  // One keyframe of the map, without points. `drifted_from_world` says where the map believes the world to be.
  KeyframeHandle AddKeyframe(Atlas* atlas, MapHandle map, const SE3& cam_from_world, const Sim3& drifted_from_world) {
    const Sight sight = Look(cam_from_world);
    const auto frame = static_cast<std::uint32_t>(frames_.size());
    const KeyframeHandle handle =
        atlas->AddKeyframe(map, frame, TimePoint{}, TransformPose(cam_from_world, drifted_from_world), sight.features);
    EXPECT_TRUE(handle.is_valid());
    frames_.push_back({handle, cam_from_world, drifted_from_world, sight.landmarks});
    return handle;
  }

  // Gives the keyframes (indices of frames()) points for all landmarks that two of them see. The epoch of a view keeps
  // points apart that are one landmark, as if tracking had not known it again. Positions are off by `noise`.
  template <typename EpochOf>
  void AddPoints(Atlas* atlas, int first_frame, int end_frame, double noise, EpochOf&& epoch_of) {
    std::map<std::tuple<int, int>, std::vector<Observation>> tracks;
    for (int f = first_frame; f < end_frame; ++f) {
      for (std::size_t i = 0; i < frames_[f].landmarks.size(); ++i) {
        const int landmark = frames_[f].landmarks[i];
        tracks[{landmark, epoch_of(f, landmark)}].push_back({frames_[f].keyframe, static_cast<std::int32_t>(i)});
      }
    }
    for (const auto& [key, views] : tracks) {
      if (views.size() < 2) continue;
      const Frame& first = FrameOf(views[0].keyframe);
      const Keyframe& keyframe = atlas->keyframe(views[0].keyframe);
      const Eigen::Vector3d position =
          first.map_from_world * (landmarks_[std::get<0>(key)].position + GaussianVector(rng_, noise));
      const MapPointHandle point = atlas->AddPoint(keyframe.map, position, keyframe.id);
      EXPECT_TRUE(point.is_valid());
      landmark_of_point_[atlas->point(point).id] = std::get<0>(key);
      for (const Observation& view : views) atlas->AddObservation(point, view.keyframe, view.feature_idx);
      atlas->UpdatePoint(point);
    }
  }

  // What mapping does for a new keyframe: it sees the points of the neighbour, and what no point shows yet becomes one,
  // where `map_from_world` puts it. Indices of frames().
  void Link(Atlas* atlas, int frame, int neighbour, const Sim3& map_from_world) {
    const KeyframeHandle keyframe = frames_[frame].keyframe, other = frames_[neighbour].keyframe;
    std::map<int, std::int32_t> features;  // of the neighbour, by landmark
    for (std::size_t i = 0; i < frames_[neighbour].landmarks.size(); ++i) {
      features[frames_[neighbour].landmarks[i]] = static_cast<std::int32_t>(i);
    }
    for (std::size_t i = 0; i < frames_[frame].landmarks.size(); ++i) {
      const int landmark = frames_[frame].landmarks[i];
      const auto seen = features.find(landmark);
      if (seen == features.end()) continue;
      MapPointHandle point = atlas->keyframe(other).points[seen->second];
      if (!point) {
        point = atlas->AddPoint(atlas->keyframe(keyframe).map, map_from_world * landmarks_[landmark].position,
                                atlas->keyframe(keyframe).id);
        EXPECT_TRUE(point.is_valid());
        landmark_of_point_[atlas->point(point).id] = landmark;
        atlas->AddObservation(point, other, seen->second);
      }
      atlas->AddObservation(point, keyframe, static_cast<std::int32_t>(i));
      atlas->UpdatePoint(point);
    }
  }

  // A whole map of `num` keyframes from z = begin to end; returns the frames' range.
  std::pair<int, int> AddMap(Atlas* atlas, double begin, double end, int num, const Sim3& map_from_world) {
    const MapHandle map = atlas->CreateMap();
    const int first = static_cast<int>(frames_.size());
    for (int i = 0; i < num; ++i) {
      AddKeyframe(atlas, map, ViewFrom(begin + (end - begin) * i / (num - 1)), map_from_world);
    }
    const int last = static_cast<int>(frames_.size());
    AddPoints(atlas, first, last, 0.005, [](int, int) { return 0; });
    return {first, last};
  }

  // A map of the wall and of its moved twin: of each view from z = begin to end, what shows the twin in the same way.
  void AddMapOfTwins(Atlas* atlas, double begin, double end, int num, const SE3& twin_from_wall,
                     const Sim3& map_from_world) {
    const MapHandle map = atlas->CreateMap();
    const int first = static_cast<int>(frames_.size());
    for (int i = 0; i < num; ++i) {
      const SE3 view = ViewFrom(begin + (end - begin) * i / (num - 1));
      AddKeyframe(atlas, map, view, map_from_world);
      AddKeyframe(atlas, map, view * twin_from_wall.Inverse(), map_from_world);
    }
    AddPoints(atlas, first, static_cast<int>(frames_.size()), 0.005, [](int, int) { return 0; });
  }

  // Of copies, as the recogniser does.
  bool Verify(CommonAreaVerifier& verifier, const Atlas& atlas, KeyframeHandle a, KeyframeHandle b, Rng& rng,
              CommonArea* out) const {
    GroupExcerpt excerpt_a(GroupExcerpt::ForQuery(config_), std::pmr::get_default_resource());
    GroupExcerpt excerpt_b(GroupExcerpt::ForCandidate(config_), std::pmr::get_default_resource());
    ExcerptCopier copier(config_);
    copier.CopyQuery(atlas, a, &excerpt_a);
    copier.CopyCandidate(atlas, b, a, &excerpt_b);
    return verifier.Verify(excerpt_a, excerpt_b, rng, out);
  }

  struct Frame {
    KeyframeHandle keyframe;
    SE3 cam_from_world;
    Sim3 map_from_world;  // when it was made
    std::vector<int> landmarks;
  };
  const std::vector<Frame>& frames() const { return frames_; }
  const Frame& FrameOf(KeyframeHandle keyframe) const {
    for (const Frame& frame : frames_) {
      if (frame.keyframe == keyframe) return frame;
    }
    ADD_FAILURE() << "not a keyframe of this colon";
    return frames_.front();
  }
  const Landmark& landmark(int i) const { return landmarks_[i]; }
  const Landmark& LandmarkOf(const MapPoint& point) const { return landmarks_[landmark_of_point_.at(point.id)]; }

 private:
  static VisionPlan Plan(int max_feature_sets) {
    VisionPlan plan;
    plan.max_width_px = 720;
    plan.max_height_px = 540;
    plan.max_features = kMaxFeatures;
    plan.max_feature_sets = max_feature_sets;
    plan.max_match_list = 8192;
    return plan;
  }

  Rng rng_;
  EngineConfig config_;
  CameraModel camera_;
  SceneRegion scene_{camera_, {}};
  ScriptedVisionDevice device_;
  std::vector<Landmark> landmarks_;
  std::vector<Frame> frames_;
  std::map<std::uint32_t, int> landmark_of_point_;
};

// How far `estimate` is from `truth` at a camera: position over depth, rotation and scale.
struct Sim3Error {
  double position = 0.0;
  double rotation_deg = 0.0;
  double scale = 0.0;
};
inline Sim3Error ErrorAt(const Sim3& estimate, const Sim3& truth, const Eigen::Vector3d& camera_in_a, double depth_b) {
  return {(estimate * camera_in_a - truth * camera_in_a).norm() / depth_b,
          RotationAngle(estimate.rotation, truth.rotation) * 180.0 / std::numbers::pi,
          std::abs(std::log(estimate.scale / truth.scale))};
}

}  // namespace haustra::test
