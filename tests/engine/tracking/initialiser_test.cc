// Two views and the time that there is to compare them.
#include "engine/tracking/initialiser.h"

#include <gtest/gtest.h>

#include "hal/fakes/manual_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

class InitialiserTest : public testing::Test {
 protected:
  InitialiserTest() { colon_.Move(0.0, 1.5, 50); }
  ~InitialiserTest() override { initialiser_.Reset(); }

  ProposedView See(int num_frames_on) {
    Result<Frame> frame = colon_.source().Next(kNoDeadline);
    for (int i = 1; i < num_frames_on; ++i) frame = colon_.source().Next(kNoDeadline);
    ProposedView view(colon_.config().features.max);
    view.frame_index = frame->index;
    view.timestamp = frame->timestamp;
    view.features.set = colon_.device().CreateFeatureSet().value();
    ExtractRequest request;
    request.image = frame->image;
    request.set = view.features.set;
    request.keypoints = view.features.keypoints;
    request.num_keypoints = &view.features.num;
    EXPECT_TRUE(lane_.Extract(request, kNoDeadline).ok());
    for (int i = 0; i < view.features.num; ++i) {
      Eigen::Vector3d bearing;
      EXPECT_TRUE(colon_.camera().Unproject(view.features.pixel(i), &bearing));
      const Eigen::Vector3f rounded = bearing.cast<float>();
      view.features.bearings[i] = {rounded.x(), rounded.y(), rounded.z()};
    }
    return view;
  }
  // `gone`: of the frame's 40 ms, before the comparison.
  TrackingReason Try(const ProposedView& view, Duration gone) {
    budget_.BeginFrame(clock_.Now() + kFramePeriod, false, false);
    EXPECT_TRUE(budget_.MayInitialise());
    clock_.Advance(gone);
    const TrackingReason reason = initialiser_.Try(view, budget_);
    budget_.EndInitialising(reason == TrackingReason::kNoTime);
    budget_.EndFrame();
    return reason;
  }

  ScriptedColon colon_;
  ManualClock clock_;
  LaneWait lane_{colon_.device()};
  FrameBudget budget_{colon_.config().scheduler, &clock_};
  OverlayWatch overlay_{colon_.config().initialisation, false, 720, 540, colon_.config().features.max};
  Initialiser initialiser_{colon_.config(), colon_.camera(), colon_.device(), lane_, overlay_, 1.0};
};

TEST_F(InitialiserTest, ComparisonIsStoppedWhenTheFrameIsOverAndNothingIsForgotten) {
  initialiser_.Keep(See(1));
  const ProposedView view = See(12);
  EXPECT_EQ(Try(view, std::chrono::milliseconds(39)), TrackingReason::kNoTime);
  EXPECT_TRUE(initialiser_.has_reference());
  EXPECT_FALSE(initialiser_.is_worn_out());
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kMapProposed);
}

TEST_F(InitialiserTest, ComparisonThatWasStoppedThreeTimesIsBroughtToItsEnd) {
  initialiser_.Keep(See(1));
  const ProposedView view = See(12);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(Try(view, std::chrono::milliseconds(39)), TrackingReason::kNoTime);
  EXPECT_EQ(Try(view, std::chrono::milliseconds(39)), TrackingReason::kMapProposed);
}

}  // namespace
}  // namespace haustra::test
