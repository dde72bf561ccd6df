// The keeper asks for the right keyframe at the right time, lends the right pictures, and keeps what it is told.
#include "engine/depth/depth_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <vector>

#include "tests/engine/place/synthetic_colon.h"

namespace haustra {
namespace {

using ::testing::HasSubstr;

// A map of keyframes along a tube. The picture of frame n is grey with the value n, and coloured (n, n, n + 100).
class DepthKeeperTest : public ::testing::Test {
 protected:
  static constexpr int kNumKeyframes = 8;

  DepthKeeperTest() : colon_(5), atlas_(colon_.MakeAtlas()) {
    colon_.config().depth.kept_pictures = 6;
    colon_.config().depth.newer_keyframes = 2;
    colon_.AddWall(-1.0, 6.0, 3000);
  }
  // The keyframes exist before their pictures come, unless a test says otherwise.
  void Begin() {
    colon_.AddMap(&atlas_, 0.0, 1.0, kNumKeyframes, Sim3());
    const CameraModel& camera = colon_.camera();
    const int step_px = colon_.config().depth.step_px;
    pictures_.emplace(kHandedPictures, std::pmr::get_default_resource(), camera.width_px(), camera.height_px(),
                      std::pmr::get_default_resource());
    mailbox_ = std::make_unique<DepthMailbox>(camera.width_px() / step_px, camera.height_px() / step_px,
                                              colon_.config().features.max, std::pmr::get_default_resource());
    keeper_.emplace(colon_.config(), camera, atlas_, *pictures_, *mailbox_, std::pmr::get_default_resource());
  }
  bool Hand(std::uint32_t frame_index, int width_px = 0) {
    const int width = width_px > 0 ? width_px : colon_.camera().width_px(), height = colon_.camera().height_px();
    const auto value = static_cast<std::uint8_t>(frame_index);
    std::vector<std::uint8_t> pixels(std::size_t(3) * width * height, value);
    for (std::size_t i = 2; i < pixels.size(); i += 3) pixels[i] = static_cast<std::uint8_t>(value + 100);
    Frame frame;
    frame.index = frame_index;
    frame.image = {pixels.data(), width, height, std::ptrdiff_t{3} * width, PixelFormat::kBgr8};
    HandedPicture* handed = pictures_->BeginPush();
    if (handed == nullptr || !handed->Copy(frame)) return false;
    pictures_->CommitPush();
    return true;
  }
  // Hands the picture of a frame, and lets the keeper work until it has nothing to do.
  void HandAndWork(std::uint32_t frame_index) {
    ASSERT_TRUE(Hand(frame_index));
    Work();
  }
  void Work() {
    while (keeper_->Step()) {
    }
  }
  // The map of the keyframes is built anew, by the reframing of this number.
  void Turn(std::uint64_t number) {
    const MapHandle map = atlas_.keyframe(KeyframeOf(0)).map;
    for (const KeyframeHandle keyframe : atlas_.map(map).keyframes) atlas_.keyframe(keyframe).turned_at = number;
  }
  KeyframeHandle KeyframeOf(int i) const { return colon_.frames()[i].keyframe; }
  // Answers with a wall at `range` everywhere.
  void Answer(double range) {
    DepthTask* task = mailbox_->Asked();
    ASSERT_NE(task, nullptr);
    task->depth.Clear(0.1);
    for (int i = 0; i < task->depth.num_cells(); ++i) task->depth.Set(i, 1.0 / range, 200);
    task->status = Status::Ok();
    mailbox_->Answer();
    Work();
  }
  // Grey value of a lent picture.
  static int ValueOf(const DepthView& view) { return view.grey.row(view.grey.height / 2)[view.grey.width / 2]; }
  // As the extractor weighs (n, n, n + 100).
  static int GreyOf(int n) { return (29 * n + 150 * n + 77 * (n + 100) + 128) >> 8; }

  test::SyntheticColon colon_;
  Atlas atlas_;
  std::optional<PictureRing> pictures_;
  std::unique_ptr<DepthMailbox> mailbox_;
  std::optional<DepthKeeper> keeper_;
};

TEST_F(DepthKeeperTest, AKeyframeTakesItsTurnWhenNewerOnesHaveCome) {
  Begin();
  HandAndWork(0);
  HandAndWork(1);
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  HandAndWork(2);
  const DepthTask* task = mailbox_->Asked();
  ASSERT_NE(task, nullptr);
  EXPECT_EQ(task->keyframe, KeyframeOf(0));
  EXPECT_EQ(ValueOf(task->reference), GreyOf(0));
  EXPECT_TRUE(
      task->reference.cam_from_map.translation.isApprox(atlas_.keyframe(KeyframeOf(0)).cam_from_map.translation));
  ASSERT_FALSE(task->sources.empty());
  for (const DepthView& source : task->sources) {
    EXPECT_THAT(ValueOf(source), ::testing::AnyOf(GreyOf(1), GreyOf(2)));
  }
  // Every point that it sees, where the camera model sees it, within the noise of the map.
  EXPECT_EQ(task->seeds.size(), static_cast<std::size_t>(atlas_.keyframe(KeyframeOf(0)).num_points));
  for (const DepthSeed& seed : task->seeds) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(colon_.camera().Project(seed.bearing, &pixel));
    EXPECT_LT((CellOfPixel(pixel, colon_.config().depth.step_px) - seed.cell).norm(), 2.0);
  }
}

TEST_F(DepthKeeperTest, WhatComesIsTakenInWithoutAQuestion) {
  Begin();
  for (std::uint32_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(Hand(i));
    EXPECT_TRUE(keeper_->TakeIn());
  }
  EXPECT_FALSE(keeper_->TakeIn());
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  EXPECT_EQ(keeper_->counters().num_pictures, 4u);
  Work();
  EXPECT_NE(mailbox_->Asked(), nullptr) << "it is asked later";
}

TEST_F(DepthKeeperTest, WhatIsAnsweredIsKeptWithItsColourUntilTheKeyframeGoes) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  EXPECT_EQ(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  Answer(2.0);
  const KeptDepth* kept = keeper_->DepthOf(KeyframeOf(0));
  ASSERT_NE(kept, nullptr);
  EXPECT_NEAR(kept->depth.range_mu(17), 2.0, 1e-3);
  EXPECT_EQ(kept->depth.confidence(17), 200);
  EXPECT_EQ(kept->bgr[0], 0);
  EXPECT_EQ(kept->bgr[2], 100);
  EXPECT_EQ(keeper_->counters().num_depths, 1u);

  atlas_.RemoveKeyframe(KeyframeOf(0), KeyframeOf(1));
  EXPECT_EQ(keeper_->DepthOf(KeyframeOf(0)), nullptr);
}

TEST_F(DepthKeeperTest, AnotherKeyframeInTheSameSlotHasNoDepthOfTheOldOne) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  Answer(2.0);
  const KeyframeHandle old = KeyframeOf(0);
  const MapHandle map = atlas_.keyframe(old).map;
  atlas_.RemoveKeyframe(old, KeyframeOf(1));
  const KeyframeHandle next = colon_.AddKeyframe(&atlas_, map, colon_.ViewFrom(0.5), Sim3());
  ASSERT_EQ(next.index, old.index);
  EXPECT_EQ(keeper_->DepthOf(next), nullptr);
}

TEST_F(DepthKeeperTest, AKeyframeThatGoesWhileItIsSearchedIsNotKept) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  atlas_.RemoveKeyframe(KeyframeOf(0), KeyframeOf(1));
  Answer(2.0);
  EXPECT_EQ(keeper_->counters().num_depths, 0u);
  EXPECT_EQ(keeper_->counters().num_in_vain, 1u);
}

TEST_F(DepthKeeperTest, TheUnitOfTheDepthIsThatOfTheKeyframeThen) {
  Begin();
  const MapHandle map = atlas_.keyframe(KeyframeOf(0)).map;
  const auto scale_map = [&](double scale) {
    atlas_.TransformMap(map, Sim3(scale, Eigen::Quaterniond::Identity(), {1.0, 0.0, 0.0}));
  };
  scale_map(0.5);
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  // Even when the map moves while the search is out.
  scale_map(3.0);
  Answer(2.0);
  const KeptDepth* kept = keeper_->DepthOf(KeyframeOf(0));
  ASSERT_NE(kept, nullptr);
  // What was two units away is six of the new ones away.
  DepthMap depth = kept->depth;
  depth.ScaleRanges(atlas_.KeyframeScale(KeyframeOf(0)) / kept->scale);
  EXPECT_NEAR(depth.range_mu(17), 6.0, 5e-3);
}

TEST_F(DepthKeeperTest, TheDepthOfAMapThatWasTurnedIsForgottenAndSearchedAgain) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  Answer(2.0);
  ASSERT_NE(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  Turn(1);
  EXPECT_EQ(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  EXPECT_EQ(keeper_->num_keyframes(), 0u);
  Work();
  ASSERT_NE(mailbox_->Asked(), nullptr) << "its picture is there";
  EXPECT_EQ(mailbox_->Asked()->keyframe, KeyframeOf(0));
  Answer(3.0);
  ASSERT_NE(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  EXPECT_NEAR(keeper_->DepthOf(KeyframeOf(0))->depth.range_mu(17), 3.0, 1e-2);
  EXPECT_EQ(mailbox_->Asked(), nullptr) << "once";
}

TEST_F(DepthKeeperTest, ASearchWhoseMapIsTurnedMeanwhileIsAskedAgain) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  ASSERT_NE(mailbox_->Asked(), nullptr);
  Turn(1);
  Answer(2.0);
  EXPECT_EQ(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  ASSERT_NE(mailbox_->Asked(), nullptr);
  EXPECT_EQ(mailbox_->Asked()->keyframe, KeyframeOf(0));
  EXPECT_EQ(keeper_->counters().num_searches, 1u);
  EXPECT_EQ(keeper_->counters().num_depths, 0u);
  Answer(3.0);
  EXPECT_NE(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  EXPECT_EQ(keeper_->counters().num_in_vain, 0u);
}

// What knew too little may know enough of the other shape; it is counted once.
TEST_F(DepthKeeperTest, AThinKeyframeIsTriedAgainWhenItsMapIsTurned) {
  colon_.config().depth.newer_keyframes = 0;
  Begin();
  HandAndWork(0);
  ASSERT_EQ(keeper_->counters().num_too_little, 1u);
  Turn(1);
  ASSERT_TRUE(keeper_->Step());
  EXPECT_FALSE(keeper_->Step());
  EXPECT_EQ(keeper_->counters().num_too_little, 1u);
}

TEST_F(DepthKeeperTest, AStoppedSearchIsAskedAgainAndAFailedOneIsNot) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  mailbox_->Asked()->status = Status(StatusCode::kCancelled);
  mailbox_->Answer();
  Work();
  ASSERT_NE(mailbox_->Asked(), nullptr);
  EXPECT_EQ(mailbox_->Asked()->keyframe, KeyframeOf(0));
  EXPECT_EQ(keeper_->counters().num_searches, 1u);
  mailbox_->Asked()->status = Status(StatusCode::kUnavailable);
  mailbox_->Answer();
  Work();
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  EXPECT_EQ(keeper_->counters().num_in_vain, 1u);
}

TEST_F(DepthKeeperTest, InTheEndAllHaveTheirTurnOldestFirst) {
  Begin();
  for (std::uint32_t i = 0; i < 4; ++i) ASSERT_TRUE(Hand(i));
  keeper_->SetFinishing(true);
  Work();
  for (int i = 0; i < 4; ++i) {
    ASSERT_NE(mailbox_->Asked(), nullptr) << i;
    EXPECT_EQ(mailbox_->Asked()->keyframe, KeyframeOf(i));
    Answer(1.0 + i);
  }
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(keeper_->DepthOf(KeyframeOf(i))->depth.range_mu(5), 1.0 + i, 1e-2);
}

TEST_F(DepthKeeperTest, AfterAFinishKeyframesWaitForNewerOnesAgain) {
  Begin();
  keeper_->SetFinishing(true);
  Work();
  keeper_->SetFinishing(false);
  HandAndWork(0);
  HandAndWork(1);
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  HandAndWork(2);
  EXPECT_NE(mailbox_->Asked(), nullptr);
}

TEST_F(DepthKeeperTest, PicturesThatAreLentAreNotWrittenOver) {
  Begin();
  for (std::uint32_t i = 0; i < 3; ++i) HandAndWork(i);
  const DepthTask* task = mailbox_->Asked();
  ASSERT_NE(task, nullptr);
  // More than there is room for; frame numbers of no keyframe.
  for (std::uint32_t i = 100; i < 120; ++i) HandAndWork(i);
  EXPECT_EQ(ValueOf(task->reference), GreyOf(0));
  for (const DepthView& source : task->sources) EXPECT_LT(ValueOf(source), GreyOf(3));
}

// The search of the first keyframe stays out, and with it the pictures of three are lent.
TEST_F(DepthKeeperTest, KeyframesWhosePicturesGoBeforeTheirTurnAreCounted) {
  Begin();
  for (std::uint32_t i = 0; i < 6; ++i) HandAndWork(i);
  EXPECT_EQ(keeper_->counters().num_late, 0u);
  // Nobody misses the depth of a keyframe that was culled.
  atlas_.RemoveKeyframe(KeyframeOf(3), KeyframeOf(1));
  HandAndWork(6);
  EXPECT_EQ(keeper_->counters().num_late, 0u);
  HandAndWork(7);
  EXPECT_EQ(keeper_->counters().num_late, 1u);
  keeper_->SetFinishing(true);
  Work();
  for (int i = 0; mailbox_->Asked() != nullptr && i < kNumKeyframes; ++i) Answer(2.0);
  const DepthCounters& counters = keeper_->counters();
  EXPECT_EQ(counters.num_depths + counters.num_too_little + counters.num_late, std::uint64_t{kNumKeyframes - 1});
  EXPECT_EQ(keeper_->num_keyframes(), counters.num_depths);
  EXPECT_EQ(keeper_->DepthOf(KeyframeOf(4)), nullptr);
}

TEST_F(DepthKeeperTest, AFullRingLosesTheNewestAndCountsIt) {
  Begin();
  for (std::uint32_t i = 0; i < kHandedPictures; ++i) EXPECT_TRUE(Hand(i));
  EXPECT_FALSE(Hand(7));
  EXPECT_EQ(pictures_->num_dropped(), 1u);
  Work();
  EXPECT_EQ(keeper_->counters().num_pictures, kHandedPictures);
}

TEST_F(DepthKeeperTest, APictureWithoutAKeyframeIsNeverAskedAbout) {
  Begin();
  keeper_->SetFinishing(true);
  HandAndWork(50);
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  // Another time of the same number: a frame of another session.
  ASSERT_TRUE(Hand(1));
  pictures_->Front()->timestamp += std::chrono::seconds(1);
  Work();
  EXPECT_EQ(mailbox_->Asked(), nullptr);
}

TEST_F(DepthKeeperTest, AloneAKeyframeHasTooLittleToCompareWith) {
  Begin();
  keeper_->SetFinishing(true);
  HandAndWork(3);
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  EXPECT_EQ(keeper_->counters().num_too_little, 1u);
}

// What was too thin when its turn came may have gained neighbours since, or points: at the end it is looked at again.
TEST_F(DepthKeeperTest, AThinKeyframeIsTriedOnceMoreAtTheEnd) {
  colon_.config().depth.newer_keyframes = 0;
  Begin();
  HandAndWork(0);
  ASSERT_EQ(keeper_->counters().num_too_little, 1u);
  HandAndWork(1);
  ASSERT_NE(mailbox_->Asked(), nullptr);
  ASSERT_EQ(mailbox_->Asked()->keyframe, KeyframeOf(1));
  Answer(2.0);
  ASSERT_EQ(mailbox_->Asked(), nullptr) << "not before the end";
  keeper_->SetFinishing(true);
  Work();
  const DepthTask* task = mailbox_->Asked();
  ASSERT_NE(task, nullptr);
  EXPECT_EQ(task->keyframe, KeyframeOf(0));
  EXPECT_EQ(ValueOf(task->reference), GreyOf(0));
  Answer(3.0);
  EXPECT_NE(keeper_->DepthOf(KeyframeOf(0)), nullptr);
  EXPECT_EQ(keeper_->counters().num_too_little, 0u) << "it was not, in the end";
  EXPECT_EQ(keeper_->counters().num_depths, 2u);
}

TEST_F(DepthKeeperTest, AKeyframeThatStaysThinIsTriedOnceAFinish) {
  colon_.config().depth.newer_keyframes = 0;
  Begin();
  HandAndWork(0);
  for (int finish = 0; finish < 2; ++finish) {
    keeper_->SetFinishing(true);
    int num_steps = 0;
    while (num_steps < 10 && keeper_->Step()) ++num_steps;
    EXPECT_EQ(num_steps, 1);
    keeper_->SetFinishing(false);
    EXPECT_FALSE(keeper_->Step());
    EXPECT_EQ(keeper_->counters().num_too_little, 1u);
  }
}

TEST_F(DepthKeeperTest, KeyframesOfAnotherMapAreNoSources) {
  Begin();
  // Sees the same wall, and has a map of its own.
  const auto [first, end] = colon_.AddMap(&atlas_, 0.0, 1.0, 2, Sim3());
  ASSERT_EQ(first, kNumKeyframes);
  ASSERT_EQ(end, kNumKeyframes + 2);
  HandAndWork(8);
  HandAndWork(0);
  keeper_->SetFinishing(true);
  Work();
  EXPECT_EQ(mailbox_->Asked(), nullptr);
  EXPECT_EQ(keeper_->counters().num_too_little, 2u);
}

TEST_F(DepthKeeperTest, ThePlanIsWhatConstructionTakes) {
  const MemoryPlan plan =
      DepthKeeper::PlanMemory(colon_.config(), colon_.camera().width_px(), colon_.camera().height_px());
  MemoryArena arena(plan.bytes(MemoryPlace::kHostArena));
  const CameraModel& camera = colon_.camera();
  PictureRing pictures(kHandedPictures, &arena, camera.width_px(), camera.height_px(), &arena);
  const int step_px = colon_.config().depth.step_px;
  DepthMailbox mailbox(camera.width_px() / step_px, camera.height_px() / step_px, colon_.config().features.max, &arena);
  const DepthKeeper keeper(colon_.config(), camera, atlas_, pictures, mailbox, &arena);
  EXPECT_EQ(arena.used_bytes(), arena.size_bytes());
}

}  // namespace
}  // namespace haustra
