// A wavy tube of landmarks that a scripted device sees, for sessions without images: which frames show what is written
// down frame by frame. thread-bound(the test).
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "engine/geometry/rng.h"
#include "hal/fakes/scripted_frame_source.h"
#include "hal/fakes/scripted_vision_device.h"
#include "tests/engine/system/small_config.h"
#include "tests/geometry/synthetic.h"

namespace haustra::test {

inline const std::atomic<bool> kNeverStop{false};
inline constexpr Duration kFramePeriod = std::chrono::milliseconds(40);

// Depth that a scripted device's grey pictures have in a moment.
inline EngineConfig QuickDepthConfig() {
  EngineConfig config = SmallEngineConfig();
  config.depth.enabled = true;
  config.depth.step_px = 8;
  config.depth.iterations = 1;
  return config;
}

class ScriptedColon {
 public:
  explicit ScriptedColon(TimePoint start = TimePoint{}, const EngineConfig& config = SmallEngineConfig())
      : start_(start),
        config_(config),
        camera_(ColonCamera()),
        device_(Engine::PlanFor(config_, camera_.calibration()), {}),
        source_(camera_.calibration()) {
    Rng rng(17);
    for (std::uint32_t id = 1; id <= 9000; ++id) {
      const double around = rng.Uniform(0.0, 2.0 * std::numbers::pi), z = rng.Uniform(-2.0, 22.0);
      const double radius = 1.0 + 0.15 * std::sin(4.0 * z) + 0.1 * std::cos(2.0 * around + z);
      landmarks_.push_back({{radius * std::cos(around), radius * std::sin(around), z}, rng.Uniform(3.0, 8.0), id});
    }
  }

  // Before the first frame: the time between the frames, 40 ms otherwise.
  void SetPeriod(Duration period) { period_ = period; }
  Duration period() const { return period_; }

  // Frames along the tube's axis; the tube has radius 1 and reaches from -2 to 22.
  void Move(double from, double to, int num_frames) {
    for (int i = 0; i < num_frames; ++i) AddView(from + (to - from) * i / std::max(1, num_frames - 1));
  }
  // Frames that show nothing.
  void Occlude(int num_frames) {
    for (int i = 0; i < num_frames; ++i) {
      centres_.emplace_back(0.0, 0.0, 0.0);
      source_.AddFrame(NextTime());
    }
  }
  // Away from a map, and in another one back to what the first shows.
  void MoveAwayAndBack() {
    Move(0.0, 4.0, 100);
    Occlude(5);
    Move(9.0, 3.0, 150);
  }
  void Damage(const std::string& message) {
    centres_.emplace_back(0.0, 0.0, 0.0);
    source_.AddFailure(StatusCode::kDataLoss, message);
    ++num_frames_;
  }
  void Fail(StatusCode code, const std::string& message) { source_.AddFailure(code, message); }

  FrameSource& source() { return source_; }
  ScriptedVisionDevice& device() { return device_; }
  const EngineConfig& config() const { return config_; }
  EngineConfig& config() { return config_; }  // capacities stay as they are
  const CameraModel& camera() const { return camera_; }
  // Where the camera truly was; zero for frames that show nothing.
  const std::vector<Eigen::Vector3d>& centres() const { return centres_; }
  TimePoint TimeOf(std::uint32_t frame_index) const { return start_ + frame_index * period_; }
  std::unique_ptr<Engine> MakeEngine(Engine::Mode mode, VisionDevice& device, const Clock* clock = nullptr) const {
    return std::make_unique<Engine>(config_, camera_, device, mode, clock, ImageView{});
  }
  std::unique_ptr<Engine> MakeEngine() { return MakeEngine(Engine::Mode::kSequential, device_); }

 private:
  struct Landmark {
    Eigen::Vector3d position;
    double size = 0.0;  // SIFT scale times distance
    std::uint32_t id = 0;
  };

  TimePoint NextTime() { return TimeOf(num_frames_++); }

  void AddView(double z) {
    const Eigen::Vector3d centre(0.15 * std::sin(3.0 * z), 0.12 * std::cos(2.0 * z), z);
    std::vector<ScriptedFeature> features;
    for (const Landmark& landmark : landmarks_) {
      const Eigen::Vector3d in_cam = landmark.position - centre;
      Eigen::Vector2d pixel;
      if (in_cam.z() < 0.3 || in_cam.norm() > 3.0 || !camera_.Project(in_cam, &pixel)) continue;
      if (rng_.Uniform() > 0.7) continue;  // not detected in this frame
      pixel += Eigen::Vector2d(rng_.Uniform(-0.5, 0.5), rng_.Uniform(-0.5, 0.5));
      if (!camera_.IsInImage(pixel)) continue;
      ScriptedFeature feature;
      feature.keypoint.x_px = static_cast<float>(pixel.x());
      feature.keypoint.y_px = static_cast<float>(pixel.y());
      feature.keypoint.scale_px = static_cast<float>(landmark.size / in_cam.norm());
      feature.keypoint.response = 1.0f / static_cast<float>(1 + landmark.id % 97);
      feature.appearance = {landmark.id, landmark.id};
      features.push_back(feature);
    }
    centres_.push_back(centre);
    device_.SetFrame(num_frames_, std::move(features));
    source_.AddFrame(NextTime());
  }

  TimePoint start_;
  Duration period_ = kFramePeriod;
  EngineConfig config_;
  CameraModel camera_;
  ScriptedVisionDevice device_;
  ScriptedFrameSource source_;
  std::vector<Landmark> landmarks_;
  std::vector<Eigen::Vector3d> centres_;
  Rng rng_{23};
  std::uint32_t num_frames_ = 0;
};

}  // namespace haustra::test
