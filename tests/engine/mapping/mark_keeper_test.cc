// Which frames can be marked: what the keeper hears of the tracker.
#include "engine/mapping/mark_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/engine/place/synthetic_colon.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra::test {
namespace {

using ::testing::HasSubstr;

class MarkKeeperTest : public testing::Test {
 protected:
  // The tracker answers with a frame that has no pose, which is what a mark in it is refused for.
  void Answer(std::uint32_t frame_index) {
    AnsweredFrame answered;
    answered.frame_index = frame_index;
    link_.Answer(answered);
  }
  std::string WhyRefused(std::uint32_t frame_index) {
    const CameraModel& camera = colon_.camera();
    const Eigen::Vector2d middle(0.5 * camera.width_px(), 0.5 * camera.height_px());
    return keeper_.Set({frame_index, middle, MarkLabel::From("polyp").value()}).status().message();
  }

  ScriptedColon colon_;
  TrackingLink link_{colon_.config()};
  SceneRegion scene_{colon_.camera(), {}};
  MappingState state_{colon_.config(), colon_.camera(), scene_, colon_.device(),
                      link_,           nullptr,         false,  std::pmr::get_default_resource()};
  MarkKeeper keeper_{state_};
};

TEST_F(MarkKeeperTest, TheNewestFrameIsTheLastThatWasAnswered) {
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("no frame yet"));
  Answer(7);
  Answer(8);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 8 has no measured pose"));
  EXPECT_THAT(WhyRefused(7), HasSubstr("frame 7 has no measured pose"));
  EXPECT_THAT(WhyRefused(9), HasSubstr("frame 9 is not one of the last"));
}

// The mapper was away for longer than the ring holds. What it hears then is old: the doctor saw a later frame.
TEST_F(MarkKeeperTest, WhatWasMissedIsNotTakenForTheNewestFrame) {
  for (std::uint32_t i = 0; i < kKeptAnswers + 25; ++i) Answer(i);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("not known"));
  EXPECT_THAT(WhyRefused(kKeptAnswers - 1), HasSubstr("has no measured pose")) << "it is known by its number";
  Answer(kKeptAnswers + 25);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 537 has no measured pose"));
}

// The tracker answers on while the keeper hears: room for the next frame, after one was lost, comes in the middle.
TEST_F(MarkKeeperTest, ALostFrameDoesNotHideANewerOne) {
  for (std::uint32_t i = 0; i <= kKeptAnswers; ++i) Answer(i);
  AnsweredFrame heard;
  ASSERT_TRUE(link_.answers.TryPop(&heard));
  Answer(kKeptAnswers + 1);
  EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 513 has no measured pose"));
  EXPECT_THAT(WhyRefused(kKeptAnswers), HasSubstr("is not known: mapping was busy for too long"));
}

TEST_F(MarkKeeperTest, AFrameThatWasDroppedIsSaidToBe) {
  for (const std::uint32_t frame : {7u, 9u, 12u}) Answer(frame);
  for (const std::uint32_t frame : {8u, 10u, 11u}) {
    EXPECT_EQ(WhyRefused(frame), "frame " + std::to_string(frame) + " was not tracked: it was dropped or damaged");
  }
  EXPECT_THAT(WhyRefused(6), HasSubstr("frame 6 is not one of the last"));
  EXPECT_THAT(WhyRefused(13), HasSubstr("frame 13 is not one of the last"));
}

// Whether the last session's frames were heard or still lie in the ring, and whether the ring has lost some.
TEST_F(MarkKeeperTest, ASessionForgetsTheFramesOfTheOneBefore) {
  for (const std::uint32_t num_frames : {3u, static_cast<std::uint32_t>(kKeptAnswers) + 3}) {
    for (const bool is_heard : {false, true}) {
      for (std::uint32_t i = 0; i < num_frames; ++i) Answer(i);
      if (is_heard) keeper_.HearTracker();
      keeper_.BeginSession();
      EXPECT_THAT(WhyRefused(2), HasSubstr("is not one of the last"));
      EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("no frame yet"));
      Answer(0);
      EXPECT_THAT(WhyRefused(kNewestFrame), HasSubstr("frame 0 has no measured pose"));
      EXPECT_THAT(WhyRefused(2), HasSubstr("is not one of the last"));
    }
  }
}

// A mark that was set in the mirror of what is seen, where no wall is.
class MarkOfYoungMapTest : public testing::Test {
 protected:
  static constexpr int kNum = 6;

  MarkOfYoungMapTest() {
    colon_.AddWall(0.0, 5.0, 3000);
    state_.active = state_.atlas.CreateMap();
    for (int i = 0; i < kNum; ++i) {
      state_.newest = colon_.AddKeyframe(&state_.atlas, state_.active, colon_.ViewFrom(0.12 * i), Sim3());
    }
    colon_.AddPoints(&state_.atlas, 0, kNum, 0.002, [](int, int) { return 0; });
  }

  // At so many times the wall's distance, along the ray of a point that the first keyframe sees near its middle.
  void SetMark(double share_of_distance) {
    const KeyframeHandle handle = colon_.frames().front().keyframe;
    const Keyframe& keyframe = state_.atlas.keyframe(handle);
    const CameraModel& camera = colon_.camera();
    const Eigen::Vector2d place(0.3 * camera.width_px(), 0.5 * camera.height_px());
    double nearest = 1e9;
    Eigen::Vector3d wall;
    for (int i = 0; i < keyframe.features.num; ++i) {
      const double offset = (keyframe.features.pixel(i) - place).norm();
      if (!keyframe.points[i] || offset >= nearest) continue;
      nearest = offset;
      wall = keyframe.cam_from_map * state_.atlas.point(keyframe.points[i]).position;
    }
    PlacedMark placed;
    placed.map = state_.active;
    placed.position = keyframe.cam_from_map.Inverse() * Eigen::Vector3d(share_of_distance * wall);
    placed.normal = -(keyframe.cam_from_map.rotation.conjugate() * wall.normalized());
    placed.radius = 0.1;
    Mark mark;
    mark.label = MarkLabel::From("polyp").value();
    mark_ = state_.atlas.AddMark(mark, handle, placed);
    wall_distance_ = wall.norm();
  }
  // Over that of the wall.
  double Distance() const { return state_.atlas.marks().At(mark_).point_in_anchor.norm() / wall_distance_; }

  SyntheticColon colon_{11};
  TrackingLink link_{colon_.config()};
  SceneRegion scene_{colon_.camera(), {}};
  MappingState state_{colon_.config(), colon_.camera(), scene_, colon_.device(),
                      link_,           nullptr,         false,  std::pmr::get_default_resource()};
  MarkKeeper keeper_{state_};
  MarkHandle mark_;
  double wall_distance_ = 0.0;
};

TEST_F(MarkOfYoungMapTest, GoesToTheWallWhenTheMapIsTurned) {
  SetMark(0.6);
  state_.turned = state_.active;
  keeper_.Refine();
  EXPECT_NEAR(Distance(), 1.0, 0.1);
}

// More of them than are measured in turn, and all of them before their keyframe goes: from another one the ray to a
// place that is no wall leads elsewhere.
TEST_F(MarkOfYoungMapTest, AllGoToTheWallBeforeTheirKeyframeIsCulled) {
  SetMark(0.6);
  const Mark first = state_.atlas.marks().At(mark_);
  const PlacedMark place = state_.atlas.PlaceOf(first);
  constexpr int kNumMarks = 6;
  std::vector<MarkHandle> marks{mark_};
  for (int i = 1; i < kNumMarks; ++i) {
    Mark mark;
    mark.label = MarkLabel::From("polyp-" + std::to_string(i)).value();
    marks.push_back(state_.atlas.AddMark(mark, first.keyframe, place));
  }
  keeper_.MapWasTurned();
  const Eigen::Vector3d eye = state_.atlas.keyframe(first.keyframe).cam_from_map.InverseTranslation();
  state_.atlas.RemoveKeyframe(first.keyframe, colon_.frames()[1].keyframe);
  for (const MarkHandle mark : marks) {
    const PlacedMark now = state_.atlas.PlaceOf(state_.atlas.marks().At(mark));
    EXPECT_NEAR((now.position - eye).norm() / wall_distance_, 1.0, 0.1) << mark.index;
  }
}

// What is built anew loses points, and the next cull may come first.
TEST_F(MarkOfYoungMapTest, GoesToTheWallThatNeighboursSeeWhenItsKeyframeLostThePoints) {
  SetMark(0.6);
  const KeyframeHandle handle = colon_.frames().front().keyframe;
  const Keyframe& keyframe = state_.atlas.keyframe(handle);
  const Eigen::Vector2d place(0.3 * colon_.camera().width_px(), 0.5 * colon_.camera().height_px());
  for (int i = 0; i < keyframe.features.num; ++i) {
    const bool is_near = (keyframe.features.pixel(i) - place).norm() < 0.2 * colon_.camera().width_px();
    if (keyframe.points[i] && is_near) state_.atlas.RemoveObservation(keyframe.points[i], handle);
  }
  keeper_.MapWasTurned();
  EXPECT_NEAR(Distance(), 1.0, 0.1);
}

// Where such a frame stood is known of the former shape only.
TEST_F(MarkOfYoungMapTest, NoFrameIsMarkedThatWasTrackedBeforeTheMapWasTurned) {
  const KeyframeHandle handle = colon_.frames()[2].keyframe;
  const Eigen::Vector2d pixel(0.3 * colon_.camera().width_px(), 0.5 * colon_.camera().height_px());
  const auto answer = [&](std::uint32_t frame_index, std::uint64_t map_epoch) {
    AnsweredFrame answered;
    answered.frame_index = frame_index;
    answered.map_epoch = map_epoch;
    answered.reference_keyframe = state_.atlas.keyframe(handle).id;
    link_.Answer(answered);
  };
  answer(3, 0);
  const Result<MarkId> before = keeper_.Set({3, pixel, MarkLabel::From("before").value()});
  EXPECT_TRUE(before.ok()) << before.status().ToString();
  state_.atlas.keyframe(handle).turned_at = 1;
  answer(4, 0);
  answer(5, 1);
  for (const std::uint32_t frame : {3u, 4u}) {
    const Status refused = keeper_.Set({frame, pixel, MarkLabel::From("late").value()}).status();
    EXPECT_EQ(refused.code(), StatusCode::kFailedPrecondition);
    EXPECT_THAT(refused.message(), HasSubstr("its map has taken another shape since"));
  }
  const Result<MarkId> after = keeper_.Set({5, pixel, MarkLabel::From("after").value()});
  EXPECT_TRUE(after.ok()) << after.status().ToString();
}

// Another frame's may be lit there: the window of a scope that is plugged in anew, or a menu.
TEST_F(MarkOfYoungMapTest, IsNotSetInTheDarkSurroundOfItsPicture) {
  const int width = colon_.camera().width_px(), height = colon_.camera().height_px();
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(width) * height, 90);
  const auto answer = [&](std::uint32_t frame_index) {
    AnsweredFrame answered;
    answered.frame_index = frame_index;
    answered.reference_keyframe = state_.atlas.keyframe(colon_.frames()[2].keyframe).id;
    answered.surround = DarkSurround({pixels.data(), width, height, width, PixelFormat::kGrey8});
    link_.Answer(answered);
  };
  answer(3);
  for (int y = 0; y < height; ++y) std::fill_n(&pixels[static_cast<std::size_t>(y) * width], width / 2, 16);
  answer(4);
  const Eigen::Vector2d pixel(0.3 * width, 0.5 * height);
  const Status refused = keeper_.Set({4, pixel, MarkLabel::From("dark").value()}).status();
  EXPECT_EQ(refused.code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(refused.message(), "frame 4: the pixel lies in the dark surround of the picture");
  const Result<MarkId> lit = keeper_.Set({3, pixel, MarkLabel::From("lit").value()});
  EXPECT_TRUE(lit.ok()) << lit.status().ToString();
}

// A fold may have come between.
TEST_F(MarkOfYoungMapTest, StaysWhereItIsWhenTheMapIsNot) {
  SetMark(0.6);
  keeper_.Refine();
  EXPECT_DOUBLE_EQ(Distance(), 0.6);
}

TEST_F(MarkOfYoungMapTest, StaysWhereItIsWhenTheMapHasGrownOld) {
  SetMark(0.6);
  state_.turned = state_.active;
  colon_.config().mapping.relief_keyframes = kNum - 1;
  keeper_.Refine();
  EXPECT_DOUBLE_EQ(Distance(), 0.6);
}

}  // namespace
}  // namespace haustra::test
