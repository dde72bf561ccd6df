// The written ground truth against the pictures: SIFT matches must satisfy the epipolar geometry of the poses and of
// the calibration to a fraction of a pixel, between near frames and between visits long apart.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <memory>
#include <vector>

#include "capture/image.h"
#include "kernels/cpu/cpu_vision_device.h"
#include "tools/render/exposure.h"
#include "tools/render/revisits.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

struct Agreement {
  int num_matches = 0;
  int num_inliers = 0;  // Sampson error below 2 px
  double median_px = 0.0;
};

class EpipolarTest : public testing::Test {
 protected:
  void Start(const RenderOptions& options) {
    auto model = SequenceModel::Create(options);
    ASSERT_TRUE(model.ok()) << model.status().message();
    model_ = std::move(*model);
    renderer_ = std::make_unique<FrameRenderer>(model_->colon(), model_->mucosa(), model_->camera(), model_->window());
    VisionPlan plan;
    plan.max_width_px = options.width_px;
    plan.max_height_px = options.height_px;
    auto device = CreateCpuVisionDevice(plan, ExtractOptions{}, 1);
    ASSERT_TRUE(device.ok()) << device.status().message();
    device_ = std::move(*device);
    ASSERT_TRUE(device_->SetStaticMask(model_->window().mask()).ok());
  }

  struct Features {
    FeatureSetHandle set;
    std::vector<Keypoint> keypoints;
  };
  Features Extract(int frame) {
    LinearImage light(model_->options().width_px, model_->options().height_px);
    model_->Expose(frame, renderer_.get(), &light);
    AutoExposure exposure;
    exposure.Start(Meter(light, model_->window()));
    Image picture;
    model_->sensor().Develop(exposure.gain(), frame, &light, &picture);
    Features features;
    features.set = *device_->CreateFeatureSet();
    features.keypoints.resize(device_->plan().max_features);
    std::int32_t count = 0;
    ExtractRequest request;
    request.image = picture.view();
    request.set = features.set;
    request.keypoints = features.keypoints;
    request.num_keypoints = &count;
    EXPECT_TRUE(ExtractAndWait(*device_, Lane::kTracking, request).ok());
    features.keypoints.resize(count);
    return features;
  }

  Agreement Compare(int frame_a, int frame_b) {
    const Features a = Extract(frame_a), b = Extract(frame_b);
    std::vector<Match> matches(a.keypoints.size());
    std::int32_t count = 0;
    MatchRequest request;
    request.query = DescriptorList::Whole(a.set);
    request.train = DescriptorList::Whole(b.set);
    request.options.max_angle_ratio = 0.8f;
    request.options.mutual = true;
    request.matches = matches;
    request.num_matches = &count;
    EXPECT_TRUE(MatchAndWait(*device_, Lane::kTracking, request).ok());
    device_->ReleaseFeatureSet(a.set);
    device_->ReleaseFeatureSet(b.set);

    const SE3 b_from_a = model_->path().WorldFromCam(model_->TimeS(frame_b)).Inverse() *
                         model_->path().WorldFromCam(model_->TimeS(frame_a));
    const Eigen::Matrix3d essential = Skew(b_from_a.translation.normalized()) * b_from_a.matrix3();
    Agreement agreement;
    std::vector<double> errors;
    for (int i = 0; i < count; ++i) {
      const Keypoint& ka = a.keypoints[matches[i].query];
      const Keypoint& kb = b.keypoints[matches[i].train];
      Eigen::Vector3d x, y;
      if (!model_->camera().Unproject(Eigen::Vector2d(ka.x_px, ka.y_px), &x)) continue;
      if (!model_->camera().Unproject(Eigen::Vector2d(kb.x_px, kb.y_px), &y)) continue;
      ++agreement.num_matches;
      // First-order geometric error on the unit sphere, in pixels of the image centre.
      const Eigen::Vector3d at_b = essential * x, at_a = essential.transpose() * y;
      const double slope = std::sqrt((at_b - at_b.dot(y) * y).squaredNorm() + (at_a - at_a.dot(x) * x).squaredNorm());
      const double error_px = model_->camera().focal_px() * std::abs(y.dot(at_b)) / slope;
      if (error_px < 2.0) errors.push_back(error_px);
    }
    agreement.num_inliers = static_cast<int>(errors.size());
    if (!errors.empty()) {
      std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
      agreement.median_px = errors[errors.size() / 2];
    }
    return agreement;
  }

  std::unique_ptr<SequenceModel> model_;
  std::unique_ptr<FrameRenderer> renderer_;
  std::unique_ptr<VisionDevice> device_;
};

TEST_F(EpipolarTest, MatchesOfNearFramesFitTheGroundTruth) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("standard"));
  options.seed = 5;
  ASSERT_NO_FATAL_FAILURE(Start(options));
  for (const int frame : {40, 200}) {
    const Agreement agreement = Compare(frame, frame + 5);
    EXPECT_GT(agreement.num_inliers, 160) << frame;
    EXPECT_GT(agreement.num_inliers, 0.8 * agreement.num_matches) << frame;
    EXPECT_LT(agreement.median_px, 0.35) << frame;
  }
}

TEST_F(EpipolarTest, MatchesOfARevisitFitTheGroundTruth) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seed = 6;
  ASSERT_NO_FATAL_FAILURE(Start(options));
  std::vector<SE3> poses;
  for (int i = 0; i < options.num_frames(); ++i) poses.push_back(model_->path().WorldFromCam(model_->TimeS(i)));
  auto revisits = FindRevisits(poses, options.rate_hz, {});
  ASSERT_FALSE(revisits.empty());
  std::sort(revisits.begin(), revisits.end(),
            [](const Revisit& a, const Revisit& b) { return a.distance_mm < b.distance_mm; });
  const Agreement agreement = Compare(revisits.front().frame_a, revisits.front().frame_b);
  EXPECT_GT(agreement.num_inliers, 100);
  EXPECT_LT(agreement.median_px, 0.5);
}

TEST_F(EpipolarTest, WrongPoseDoesNotFit) {
  // The measure itself can fail: the same pictures against poses half a second off.
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seed = 5;
  ASSERT_NO_FATAL_FAILURE(Start(options));
  const Agreement right = Compare(40, 45);
  const Features unrelated = Extract(300);
  EXPECT_GT(unrelated.keypoints.size(), 300u);
  const Agreement across = Compare(40, 240);
  EXPECT_LT(across.num_inliers, right.num_inliers / 5);
}

TEST_F(EpipolarTest, EventsLeaveNothingToMatch) {
  RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
  options.seed = 7;
  options.events = {{EventKind::kRedout, 2.0, 1.0},
                    {EventKind::kWater, 4.0, 1.0},
                    {EventKind::kBubbles, 6.0, 1.0},
                    {EventKind::kDebris, 8.0, 1.0},
                    {EventKind::kBlur, 12.0, 1.0}};
  ASSERT_NO_FATAL_FAILURE(Start(options));
  const Agreement undisturbed = Compare(35, 40);
  for (const Event& event : options.events) {
    const int before = static_cast<int>(event.start_s * 25.0) - 5;
    const Agreement broken = Compare(before, before + 15);
    EXPECT_LT(broken.num_inliers, undisturbed.num_inliers / 4) << ToString(event.kind);
  }
}

}  // namespace
}  // namespace haustra::render
