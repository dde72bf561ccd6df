#include "platform/session/warm_up.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <vector>

#include "hal/forwarding_vision_device.h"
#include "platform/assemble.h"
#include "tests/tools/run/scripted_colon.h"
#include "tests/tools/run/small_vision_plan.h"

namespace haustra {
namespace {

// Writes down what it is asked for.
class ListeningDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    images.push_back(request.image);
    num_to_follow.push_back(request.follow.size());
    EXPECT_EQ(lane, Lane::kTracking);
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    (request.epipolar != nullptr ? gated : matched).insert(lane);
    return ForwardingVisionDevice::EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    guided.insert(lane);
    return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request);
  }

  std::vector<ImageView> images;
  std::vector<std::size_t> num_to_follow;
  std::set<Lane> matched, gated, guided;
};

std::unique_ptr<VisionDevice> MakeCpuDevice() {
  return CreateVisionDevice("cpu", test::SmallVisionPlan(), {.num_features = 300}, 1).value();
}

TEST(WarmUp, AsksForEachKindThatASessionAsksForAndLeavesNothing) {
  const std::unique_ptr<VisionDevice> cpu = MakeCpuDevice();
  ListeningDevice device(*cpu);
  const int num_free = device.num_free_feature_sets();
  const Result<int> num_features = WarmUp(device, 320, 240, PixelFormat::kYuyv);
  ASSERT_TRUE(num_features.ok()) << num_features.status().ToString();
  ASSERT_EQ(device.images.size(), 2u);
  for (const ImageView& image : device.images) {
    EXPECT_EQ(image.format, PixelFormat::kYuyv);
    EXPECT_EQ(image.width, 320);
    EXPECT_EQ(image.height, 240);
    EXPECT_EQ(image.pitch_bytes, 640) << "as a session hands frames over";
  }
  EXPECT_EQ(device.num_to_follow[0], 0u);
  EXPECT_GE(device.num_to_follow[1], 100u);
  const std::set<Lane> both = {Lane::kTracking, Lane::kBackground};
  EXPECT_EQ(device.matched, both);
  EXPECT_EQ(device.gated, both);
  EXPECT_EQ(device.guided, both);
  EXPECT_EQ(device.num_free_feature_sets(), num_free);
}

TEST(WarmUp, FramesOfAFileAreTakenToBeInColour) {
  test::ScriptedColon colon;
  ListeningDevice device(colon.device());
  colon.Move(0.0, 0.1, 2);
  ASSERT_EQ(colon.source().pixel_format(), std::nullopt);
  ASSERT_TRUE(WarmUp(device, colon.source()).ok());
  EXPECT_EQ(device.images[0].format, PixelFormat::kBgr8);
  EXPECT_EQ(device.images[0].width, colon.camera().calibration().width_px);
}

TEST(WarmUp, ErrorOfTheDeviceIsPassedOnAndTheSetReleased) {
  test::ScriptedColon colon;
  const int num_free = colon.device().num_free_feature_sets();
  colon.device().AddFailure(ScriptedVisionDevice::Operation::kExtract, 0, ScriptedVisionDevice::FailurePoint::kWait,
                            StatusCode::kUnavailable);
  const CameraCalibration& camera = colon.camera().calibration();
  EXPECT_EQ(WarmUp(colon.device(), camera.width_px, camera.height_px, PixelFormat::kGrey8).code(),
            StatusCode::kUnavailable);
  EXPECT_EQ(colon.device().num_free_feature_sets(), num_free);
}

TEST(WarmUp, MadeUpPictureHasFeaturesInEveryFormat) {
  const std::unique_ptr<VisionDevice> device = MakeCpuDevice();
  for (const PixelFormat format :
       {PixelFormat::kGrey8, PixelFormat::kBgr8, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    const Result<int> num_features = WarmUp(*device, 320, 240, format);
    ASSERT_TRUE(num_features.ok()) << num_features.status().ToString();
    EXPECT_GE(*num_features, 100) << static_cast<int>(format);
  }
}

}  // namespace
}  // namespace haustra
