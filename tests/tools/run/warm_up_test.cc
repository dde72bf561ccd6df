#include "platform/session/warm_up.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <vector>

#include "hal/forwarding_vision_device.h"
#include "platform/assemble.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

// Writes down what it is asked for.
class ListeningDevice final : public ForwardingVisionDevice {
 public:
  using ForwardingVisionDevice::ForwardingVisionDevice;

  Result<Ticket> EnqueueExtract(Lane lane, const ExtractRequest& request) override {
    images.push_back(request.image);
    EXPECT_EQ(lane, Lane::kTracking);
    return ForwardingVisionDevice::EnqueueExtract(lane, request);
  }
  Result<Ticket> EnqueueMatch(Lane lane, const MatchRequest& request) override {
    matched.insert(lane);
    return ForwardingVisionDevice::EnqueueMatch(lane, request);
  }
  Result<Ticket> EnqueueGuidedMatch(Lane lane, const GuidedMatchRequest& request) override {
    guided.insert(lane);
    return ForwardingVisionDevice::EnqueueGuidedMatch(lane, request);
  }

  std::vector<ImageView> images;
  std::set<Lane> matched, guided;
};

TEST(WarmUp, AsksOnceForWhatASessionAsksForAndLeavesNothing) {
  test::ScriptedColon colon;
  ListeningDevice device(colon.device());
  const int num_free = device.num_free_feature_sets();
  const CameraCalibration& camera = colon.camera().calibration();
  const Result<int> num_features = WarmUp(device, camera.width_px, camera.height_px, PixelFormat::kYuyv);
  ASSERT_TRUE(num_features.ok()) << num_features.status().ToString();
  ASSERT_EQ(device.images.size(), 1u);
  EXPECT_EQ(device.images[0].format, PixelFormat::kYuyv);
  EXPECT_EQ(device.images[0].width, camera.width_px);
  EXPECT_EQ(device.images[0].height, camera.height_px);
  EXPECT_EQ(device.images[0].pitch_bytes, 2 * camera.width_px) << "as a session hands frames over";
  const std::set<Lane> both = {Lane::kTracking, Lane::kBackground};
  EXPECT_EQ(device.matched, both);
  EXPECT_EQ(device.guided, both);
  EXPECT_EQ(device.num_free_feature_sets(), num_free);
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
  VisionPlan plan;
  plan.max_width_px = 320;
  plan.max_height_px = 240;
  plan.max_features = 500;
  plan.max_feature_sets = 2;
  plan.max_match_list = 100;
  const Result<std::unique_ptr<VisionDevice>> device = CreateVisionDevice("cpu", plan, {.num_features = 500}, 1);
  ASSERT_TRUE(device.ok()) << device.status().ToString();
  for (const PixelFormat format :
       {PixelFormat::kGrey8, PixelFormat::kBgr8, PixelFormat::kNv12, PixelFormat::kYuyv, PixelFormat::kUyvy}) {
    const Result<int> num_features = WarmUp(**device, 320, 240, format);
    ASSERT_TRUE(num_features.ok()) << num_features.status().ToString();
    EXPECT_GE(*num_features, 100) << static_cast<int>(format);
  }
}

}  // namespace
}  // namespace haustra
