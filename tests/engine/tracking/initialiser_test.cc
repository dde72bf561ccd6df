// Two views and the time that there is to compare them.
#include "engine/tracking/initialiser.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "hal/fakes/timed_vision_device.h"
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
    FillBearings(&view);
    return view;
  }
  void FillBearings(ProposedView* view) const {
    for (int i = 0; i < view->features.num; ++i) {
      Eigen::Vector3d bearing;
      EXPECT_TRUE(colon_.camera().Unproject(view->features.pixel(i), &bearing));
      const Eigen::Vector3f rounded = bearing.cast<float>();
      view->features.bearings[i] = {rounded.x(), rounded.y(), rounded.z()};
    }
  }
  // The wall has moved by itself: each feature by up to `most_px`, in directions that turn along the list.
  void MoveWall(double most_px, ProposedView* view) const {
    for (int i = 0; i < view->features.num; ++i) {
      const double px = most_px * std::fmod(i * std::numbers::phi, 1.0);
      view->features.keypoints[i].x_px += static_cast<float>(px * std::cos(0.1 * i));
      view->features.keypoints[i].y_px += static_cast<float>(px * std::sin(0.1 * i));
    }
    FillBearings(view);
  }
  // The same features on a plane before camera a, whose z grows by `slope` a unit of x, seen from b.
  ProposedView SeePlaneFrom(const SE3& b_from_a, double slope, const ProposedView& view_in_a) {
    constexpr double kZ = 3.0;
    ProposedView view(colon_.config().features.max);
    CopyView(view_in_a, &view);
    view.timestamp += std::chrono::seconds(1);
    for (int i = 0; i < view.features.num; ++i) {
      const Eigen::Vector3d ray = view_in_a.features.bearing(i).cast<double>();
      const Eigen::Vector3d point = kZ / (ray.z() - slope * ray.x()) * ray;
      Eigen::Vector2d pixel;
      EXPECT_TRUE(colon_.camera().Project(b_from_a * point, &pixel));
      view.features.keypoints[i].x_px = static_cast<float>(pixel.x());
      view.features.keypoints[i].y_px = static_cast<float>(pixel.y());
    }
    FillBearings(&view);
    std::vector<std::uint8_t> descriptors(static_cast<std::size_t>(view.features.num) * 128);
    EXPECT_TRUE(colon_.device().ReadDescriptors(view.features.set, descriptors).ok());
    view.features.set = colon_.device().CreateFeatureSet().value();
    const std::span keypoints(view.features.keypoints.data(), static_cast<std::size_t>(view.features.num));
    EXPECT_TRUE(colon_.device().WriteFeatures(view.features.set, keypoints, descriptors).ok());
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
  SceneRegion scene_{colon_.camera(), {}};
  Initialiser initialiser_{colon_.config(), colon_.camera(), colon_.device(), lane_, overlay_, scene_};
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

TEST_F(InitialiserTest, DeviceIsNotWaitedForBeyondTheFrame) {
  TimedVisionDevice slow(colon_.device(), clock_, [this](TimePoint until) { clock_.AdvanceTo(until); });
  slow.SetModel({.match = 2 * kFramePeriod});
  LaneWait lane(slow);
  Initialiser initialiser(colon_.config(), colon_.camera(), slow, lane, overlay_, scene_);
  initialiser.Keep(See(1));
  const ProposedView view = See(12);
  const TimePoint due = clock_.Now() + kFramePeriod;
  budget_.BeginFrame(due, false, false);
  EXPECT_EQ(initialiser.Try(view, budget_), TrackingReason::kNoTime);
  EXPECT_LE(clock_.Now(), due);
  EXPECT_TRUE(initialiser.has_reference());
  EXPECT_TRUE(lane.Drain(kNoDeadline));
  initialiser.Reset();
}

// Overlays, and what the camera model does not reach, agree with every motion.
TEST_F(InitialiserTest, FeaturesWithoutABearingTellNothingOfTheMotion) {
  ProposedView reference = See(1);
  ProposedView view = See(12);
  const auto blank_half = [](FrameFeatures* features) {
    for (int i = 0; i < features->num; ++i) {
      const Keypoint& at = features->keypoints[i];
      if ((std::lround(at.x_px / 180.0F) + std::lround(at.y_px / 180.0F)) % 2 != 0) features->bearings[i] = Bearing{};
    }
  };
  blank_half(&reference.features);
  blank_half(&view.features);
  initialiser_.Keep(reference);
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kMapProposed);
}

// The same two views: of a wall that stands still, and of one that has moved by itself meanwhile.
TEST_F(InitialiserTest, FoundingIsRefusedWhereTheMatchesLeaveTheDirectionOpen) {
  double& limit_deg = colon_.config().initialisation.max_direction_sigma_deg;
  limit_deg = 1.2;
  initialiser_.Keep(See(1));
  ProposedView view = See(4);
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kMapProposed);
  MoveWall(11.0, &view);
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kUncertainMotion);
  EXPECT_TRUE(initialiser_.has_reference());
  // Nothing but the limit refuses it.
  limit_deg = 5.0;
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kMapProposed);
}

// Two motions explain a plane. The reference is as good as before, and a later view may decide.
TEST_F(InitialiserTest, FoundingWaitsWhereTwoMotionsFitAlike) {
  const ProposedView first = See(1);
  const ProposedView second = SeePlaneFrom(SE3(Eigen::Quaterniond::Identity(), {0.3, 0.1, 0.05}), 0.4, first);
  initialiser_.Keep(first);
  EXPECT_EQ(Try(second, Duration{0}), TrackingReason::kUncertainMotion);
  EXPECT_TRUE(initialiser_.has_reference());
  EXPECT_FALSE(initialiser_.is_worn_out());
}

// A reference that nothing explains does not hold up a founding: the view after it founds the map, one call later.
TEST_F(InitialiserTest, ViewAfterAReferenceThatNothingExplainsFoundsTheMap) {
  ProposedView spoilt = See(1);
  MoveWall(120.0, &spoilt);
  initialiser_.Keep(spoilt);
  const ProposedView good = See(1);
  initialiser_.Keep(good);
  const ProposedView later = See(12);
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kNoEpipolarGeometry);
  EXPECT_TRUE(initialiser_.has_reference());
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kMapProposed);
  // The mapper had no room for the proposal: the next frame founds the map with the same view.
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kMapProposed);

  KeyframeProposal proposal(colon_.config().features.max, colon_.config().initialisation.kept_views);
  initialiser_.MoveInto(&proposal);
  EXPECT_EQ(proposal.reference.frame_index, good.frame_index);
  EXPECT_EQ(proposal.num_between, 0);
  colon_.device().ReleaseFeatureSet(proposal.reference.features.set);
}

// The reference has its turn again and again; what nothing explains for long is given up, with half of what was kept.
TEST_F(InitialiserTest, ReferenceThatNothingExplainsForLongIsGivenUp) {
  ProposedView spoilt = See(1);
  MoveWall(120.0, &spoilt);
  initialiser_.Keep(spoilt);
  for (int i = 0; i < 2; ++i) {
    const ProposedView view = See(5);
    EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kNoEpipolarGeometry);
    EXPECT_FALSE(initialiser_.is_worn_out());
  }
  const ProposedView view = See(5);
  EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kNoEpipolarGeometry);
  EXPECT_TRUE(initialiser_.is_worn_out());
  initialiser_.RenewReference();
  EXPECT_FALSE(initialiser_.has_reference());
}

// A scope that hardly moves spoils no reference, however long: of the whole motion there will be enough.
TEST_F(InitialiserTest, ReferenceIsKeptWhileHardlyAnythingMoves) {
  InitialisationConfig& options = colon_.config().initialisation;
  const double sigma_px = options.noise_sigma_0_px;
  options.noise_sigma_0_px = 40.0;
  initialiser_.Keep(See(1));
  for (int i = 0; i < 4; ++i) {
    const ProposedView view = See(5);
    EXPECT_EQ(Try(view, Duration{0}), TrackingReason::kLowParallax);
    EXPECT_FALSE(initialiser_.is_worn_out());
  }
  options.noise_sigma_0_px = sigma_px;
  EXPECT_EQ(Try(See(1), Duration{0}), TrackingReason::kMapProposed);
}

// Bubbles drift together for a moment, and two views of a moment found a map of them.
TEST_F(InitialiserTest, ViewsOfOneMomentFoundNothing) {
  const auto least = std::chrono::milliseconds(std::lround(colon_.config().initialisation.min_gap_ms));
  const ProposedView first = See(1);
  initialiser_.Keep(first);
  ProposedView later = See(12);
  later.timestamp = first.timestamp + least - std::chrono::milliseconds(1);
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kLowParallax);
  EXPECT_FALSE(initialiser_.is_worn_out());
  later.timestamp = first.timestamp + least;
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kMapProposed);
}

// While parallax is wanting, younger views have still less: the oldest stays the one that is compared with.
TEST_F(InitialiserTest, ReferenceIsComparedAgainWhileParallaxIsWanting) {
  InitialisationConfig& options = colon_.config().initialisation;
  options.min_parallax_deg = 30.0;
  options.min_parallax_sigmas = 100.0;
  const ProposedView first = See(1);
  initialiser_.Keep(first);
  initialiser_.Keep(See(1));
  const ProposedView later = See(6);
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kLowParallax);
  options.min_parallax_deg = 0.4;
  EXPECT_EQ(Try(later, Duration{0}), TrackingReason::kMapProposed);

  KeyframeProposal proposal(colon_.config().features.max, options.kept_views);
  initialiser_.MoveInto(&proposal);
  EXPECT_EQ(proposal.reference.frame_index, first.frame_index);
  EXPECT_EQ(proposal.num_between, 1);
  colon_.device().ReleaseFeatureSet(proposal.reference.features.set);
  colon_.device().ReleaseFeatureSet(proposal.between[0].features.set);
}

// The choice of the view to compare with outlives the thinning out of those that are kept.
TEST_F(InitialiserTest, ViewsAreThinnedOutBetweenTwoComparisons) {
  colon_.config().initialisation.kept_views = 4;
  Initialiser initialiser(colon_.config(), colon_.camera(), colon_.device(), lane_, overlay_, scene_);
  const auto try_view = [&](const ProposedView& view) {
    budget_.BeginFrame(clock_.Now() + kFramePeriod, false, false);
    EXPECT_TRUE(budget_.MayInitialise());
    const TrackingReason reason = initialiser.Try(view, budget_);
    budget_.EndInitialising(false);
    budget_.EndFrame();
    return reason;
  };
  const auto spoilt = [this] {
    ProposedView view = See(1);
    MoveWall(120.0, &view);
    return view;
  };
  initialiser.Keep(spoilt());
  for (int i = 0; i < 4; ++i) initialiser.Keep(spoilt());
  ProposedView last = See(8);
  MoveWall(240.0, &last);
  // Reference, the second kept view, the third: the next is none that thinning out leaves where it was.
  for (int i = 0; i < 2; ++i) EXPECT_EQ(try_view(last), TrackingReason::kNoEpipolarGeometry);
  initialiser.Keep(last);
  EXPECT_EQ(try_view(See(1)), TrackingReason::kNoEpipolarGeometry);
  initialiser.Reset();
}

}  // namespace
}  // namespace haustra::test
