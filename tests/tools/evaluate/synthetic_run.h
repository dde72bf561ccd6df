// Runs made by geometry: a camera goes round a bent ring, true poses are known exactly, and what the run "estimated" is
// the truth, moved into the frame of reference and the scale of its map and spoilt in ways that the test chooses.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "tools/evaluate/evaluate_run.h"
#include "tools/evaluate/evaluated_frame.h"

namespace haustra::evaluate {

inline constexpr double kDepth = 30.0;       // of the scene, mm
inline constexpr int kFramesPerRound = 200;  // then the camera is where it was
inline constexpr std::int64_t kPeriodNs = 40000000;

// World_from_cam of a frame, mm. The camera looks along the ring, a little outwards.
inline SE3 TruePose(std::int64_t frame_idx) {
  const double t = 2.0 * std::numbers::pi * static_cast<double>(frame_idx % kFramesPerRound) / kFramesPerRound;
  const Eigen::Vector3d centre(60.0 * std::cos(t), 60.0 * std::sin(t), 12.0 * std::sin(2.0 * t));
  const Eigen::Vector3d forward =
      Eigen::Vector3d(-std::sin(t) + 0.2 * std::cos(t), std::cos(t) + 0.2 * std::sin(t), 0.1 * std::cos(t))
          .normalized();
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d world_from_cam;
  world_from_cam << right, forward.cross(right), forward;
  return SE3(world_from_cam, centre);
}

// A frame of reference and scale like that of a monocular map.
inline Sim3 MapFromWorld(int map_id) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1.0, 0.3 * map_id, -0.5).normalized();
  return Sim3(0.02 + 0.01 * map_id, Eigen::Quaterniond(Eigen::AngleAxisd(0.7 + map_id, axis)),
              Eigen::Vector3d(1.0, -2.0, 0.5 * map_id));
}

// A camera pose in another frame of reference; both world_from_cam.
inline SE3 Moved(const Sim3& b_from_a, const SE3& a_from_cam) {
  return SE3(b_from_a.rotation * a_from_cam.rotation, b_from_a * a_from_cam.translation);
}

// Independent noise of the centre, standard deviation `sigma` on each axis.
class Jitter {
 public:
  explicit Jitter(double sigma, unsigned seed = 1) : rng_(seed), normal_(0.0, sigma) {}
  SE3 operator()(SE3 pose) {
    pose.translation += Eigen::Vector3d(normal_(rng_), normal_(rng_), normal_(rng_));
    return pose;
  }

 private:
  std::mt19937 rng_;
  std::normal_distribution<double> normal_;
};

// A frame that was answered in `live_map_id` and lies in `map_id` at the end, at `believed` (world, mm) instead of
// where it truly was.
inline EvaluatedFrame MakeFrame(std::int64_t frame_idx, int live_map_id, int map_id, const SE3& believed) {
  EvaluatedFrame frame;
  frame.frame_idx = frame_idx;
  frame.live_map_id = live_map_id;
  frame.map_id = map_id;
  frame.truth = TruePose(frame_idx);
  frame.estimated = Moved(MapFromWorld(map_id), believed);
  frame.depth = kDepth;
  return frame;
}

inline EvaluatedFrame LostFrame(std::int64_t frame_idx) {
  EvaluatedFrame frame;
  frame.frame_idx = frame_idx;
  frame.truth = TruePose(frame_idx);
  frame.depth = kDepth;
  return frame;
}

inline RunEventRow Event(std::int64_t frame_idx, const char* event, int map_id, int other_map_id = -1) {
  RunEventRow row;
  row.frame_idx = frame_idx;
  row.event = event;
  row.map_id = map_id;
  row.other_map_id = other_map_id;
  return row;
}

// The same as a run that was read from a folder.
inline RunFrame MakeRunFrame(std::int64_t frame_idx, int live_map_id, int map_id, const SE3& believed) {
  RunFrame frame;
  frame.frame_idx = frame_idx;
  frame.timestamp_ns = frame_idx * kPeriodNs;
  frame.live_map_id = live_map_id;
  frame.map_id = map_id;
  if (map_id >= 0) frame.world_from_cam = Moved(MapFromWorld(map_id), believed);
  return frame;
}

inline Reference TrueReference(std::int64_t num_frames) {
  Reference reference;
  reference.unit = "mm";
  for (std::int64_t i = 0; i < num_frames; ++i) {
    const SE3 pose = TruePose(i);
    GroundTruthPose truth;
    truth.timestamp_ns = i * kPeriodNs;
    for (int axis = 0; axis < 3; ++axis) truth.position_in_world[axis] = pose.translation[axis];
    truth.world_from_cam_xyzw = {pose.rotation.x(), pose.rotation.y(), pose.rotation.z(), pose.rotation.w()};
    reference.poses.push_back(truth);
  }
  return reference;
}

inline CameraCalibration WideCamera() {
  CameraCalibration camera;
  camera.kind = CameraModelKind::kKannalaBrandt;
  camera.width_px = 720;
  camera.height_px = 540;
  camera.fx = camera.fy = 398.0;
  camera.cx = 359.5;
  camera.cy = 269.5;
  return camera;
}

}  // namespace haustra::evaluate
