// The engine on the CPU device, with pictures: what the scripted device answers at a deadline, the real one does, too.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "engine/engine.h"
#include "engine/geometry/rng.h"
#include "kernels/cpu/cpu_vision_device.h"
#include "platform/clock/system_clock.h"
#include "tests/engine/system/small_config.h"
#include "tests/kernels/blob_scene.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr Duration kFar = std::chrono::seconds(1000);

CameraModel Camera() {
  CameraCalibration calibration;
  calibration.kind = CameraModelKind::kPinhole;
  calibration.width_px = kWidth;
  calibration.height_px = kHeight;
  calibration.rate_hz = 25.0;
  calibration.fx = calibration.fy = 250.0;
  calibration.cx = 159.5;
  calibration.cy = 119.5;
  return CameraModel::Create(calibration).value();
}

// Spots in a cloud before the camera, which moves sideways.
class Scene {
 public:
  Scene() {
    Rng rng(5);
    for (int i = 0; i < 900; ++i) {
      spots_.push_back({{rng.Uniform(-3.0, 4.0), rng.Uniform(-2.0, 2.0), rng.Uniform(2.0, 4.0)},
                        rng.Uniform(0.015, 0.05),
                        rng.Uniform(25.0, 60.0) * (rng.Uniform() < 0.5 ? -1.0 : 1.0)});
    }
  }

  testing::Picture View(const CameraModel& camera, double x) const {
    std::vector<testing::Blob> blobs;
    for (const Spot& spot : spots_) {
      const Eigen::Vector3d in_cam = spot.position - Eigen::Vector3d(x, 0.3 * x, 0.0);
      Eigen::Vector2d pixel;
      if (!camera.Project(in_cam, &pixel) || pixel.x() < -20 || pixel.x() > kWidth + 20) continue;
      if (pixel.y() < -20 || pixel.y() > kHeight + 20) continue;
      blobs.push_back({pixel.x(), pixel.y(), 250.0 * spot.size / in_cam.z(), spot.height});
    }
    return testing::Render(blobs, kWidth, kHeight, 120.0);
  }

 private:
  struct Spot {
    Eigen::Vector3d position;
    double size;
    double height;
  };
  std::vector<Spot> spots_;
};

class CpuDeviceEngine : public ::testing::TestWithParam<int> {
 protected:
  CpuDeviceEngine() : camera_(Camera()), config_(test::SmallEngineConfig()) {
    // A wait for the device that begins within this time of the deadline ends at once.
    config_.scheduler.reserve_ms = 100.0;
    config_.features.border_threshold = 0;
    device_ = CreateCpuVisionDevice(Engine::PlanFor(config_, camera_.calibration()), Engine::ExtractOptionsFor(config_),
                                    GetParam())
                  .value();
    engine_ = std::make_unique<Engine>(config_, camera_, *device_, Engine::Mode::kRealTime, &clock_, ImageView{});
  }

  FrameResult Track(Duration time) {
    picture_ = scene_.View(camera_, 0.012 * index_);
    Frame frame;
    frame.index = index_;
    frame.timestamp = TimePoint(index_ * milliseconds(40));
    frame.image = picture_.view();
    ++index_;
    const FrameResult result = engine_->Track(frame, clock_.Now() + time);
    is_released_ = engine_->MayReleaseFrame(clock_.Now());
    while (engine_->BackgroundStep()) {
    }
    return result;
  }

  SystemClock clock_;
  CameraModel camera_;
  EngineConfig config_;
  Scene scene_;
  std::unique_ptr<VisionDevice> device_;
  std::unique_ptr<Engine> engine_;
  testing::Picture picture_;
  std::uint32_t index_ = 0;
  bool is_released_ = false;
};

TEST_P(CpuDeviceEngine, FrameWithoutTimeForItsFeaturesHasAPredictedPose) {
  FrameResult result;
  for (int i = 0; i < 60 && result.reason != TrackingReason::kTracked; ++i) result = Track(kFar);
  for (int i = 0; i < 5; ++i) result = Track(kFar);
  ASSERT_EQ(result.reason, TrackingReason::kTracked);
  const std::int32_t num_free = device_->num_free_feature_sets();

  const FrameResult predicted = Track(milliseconds(99));
  EXPECT_EQ(predicted.reason, TrackingReason::kPredicted);
  EXPECT_EQ(predicted.state, TrackingState::kTracking);
  EXPECT_EQ(predicted.num_features, 0);
  EXPECT_TRUE(is_released_) << "what nobody works on any more needs no picture";
  EXPECT_GE(device_->num_free_feature_sets(), num_free);

  const FrameResult next = Track(kFar);
  EXPECT_EQ(next.reason, TrackingReason::kTracked);
  EXPECT_EQ(next.map_id, result.map_id);
}

INSTANTIATE_TEST_SUITE_P(Threads, CpuDeviceEngine, ::testing::Values(1, 3));

}  // namespace
}  // namespace haustra
