#include "tools/evaluate/recall.h"

#include <gtest/gtest.h>

#include "tests/tools/evaluate/synthetic_run.h"

namespace haustra::evaluate {
namespace {

class RecallTest : public ::testing::Test {
 protected:
  void Add(int first, int last, int live_map_id, int map_id) {
    for (int i = first; i <= last; ++i) frames_.push_back(MakeFrame(i, live_map_id, map_id, TruePose(i)));
  }
  void AddLost(int first, int last) {
    for (int i = first; i <= last; ++i) frames_.push_back(LostFrame(i));
  }
  Recall Merges() const { return FindMergeRecall(frames_, shared_view_); }

  SharedView shared_view_{*CameraModel::Create(WideCamera())};
  std::vector<EvaluatedFrame> frames_;
};

TEST_F(RecallTest, MapsOfOnePlaceAreAnOccasionAndTakenWhenTheyEndAsOne) {
  Add(20, 60, 1, 1);
  Add(220, 260, 2, 1);
  EXPECT_EQ(Merges().occasions, 1u);
  EXPECT_EQ(Merges().taken, 1u);
}

TEST_F(RecallTest, MapsOfOnePlaceThatStayApartAreMissed) {
  Add(20, 60, 1, 1);
  Add(220, 260, 2, 2);
  EXPECT_EQ(Merges().occasions, 1u);
  EXPECT_EQ(Merges().taken, 0u);
}

TEST_F(RecallTest, MapsOfDifferentPlacesAreNoOccasion) {
  Add(20, 40, 1, 1);
  Add(120, 140, 2, 2);
  EXPECT_EQ(Merges().occasions, 0u);
  EXPECT_FALSE(Merges().value().has_value());
}

TEST_F(RecallTest, ThreeMapsOfOnePlaceAreThreePairsThatTwoMergesTake) {
  Add(20, 60, 1, 1);
  Add(220, 260, 2, 1);
  Add(420, 460, 3, 1);
  EXPECT_EQ(Merges().occasions, 3u);
  EXPECT_EQ(Merges().taken, 3u);
}

TEST_F(RecallTest, FramesInWhichNothingCanBeSeenAreNoOccasion) {
  Add(20, 60, 1, 1);
  Add(220, 260, 2, 2);
  for (EvaluatedFrame& frame : frames_) frame.is_clear = frame.live_map_id != 2;
  EXPECT_EQ(Merges().occasions, 0u);
}

TEST_F(RecallTest, DroppedMapsAreNoOccasion) {
  Add(20, 60, 1, 1);
  Add(220, 260, 2, -1);
  EXPECT_EQ(Merges().occasions, 0u);
}

TEST_F(RecallTest, LossInSightOfTheMapIsAnOccasionToRelocalise) {
  Add(20, 60, 1, 1);
  AddLost(61, 70);
  Add(71, 90, 1, 1);
  const Recall recall = FindRelocalisationRecall(frames_, {}, shared_view_);
  EXPECT_EQ(recall.occasions, 1u);
  EXPECT_EQ(recall.taken, 1u);
}

TEST_F(RecallTest, NewMapInSightOfTheOldOneIsAMissedRelocalisation) {
  Add(20, 60, 1, 1);
  AddLost(61, 70);
  Add(71, 90, 2, 2);
  const Recall recall = FindRelocalisationRecall(frames_, {}, shared_view_);
  EXPECT_EQ(recall.occasions, 1u);
  EXPECT_EQ(recall.taken, 0u);
}

TEST_F(RecallTest, LossOutOfSightIsNoOccasionToRelocalise) {
  Add(20, 40, 1, 1);
  // Blind until the camera is far away, where a new map begins.
  AddLost(41, 119);
  for (EvaluatedFrame& frame : frames_) frame.is_clear = frame.live_map_id >= 0;
  Add(120, 140, 2, 2);
  EXPECT_EQ(FindRelocalisationRecall(frames_, {}, shared_view_).occasions, 0u);
}

TEST_F(RecallTest, TrackingGoesOnInTheLostMapUnderAnotherIdAfterAMerge) {
  Add(20, 60, 1, 1);
  AddLost(61, 100);
  Add(220, 260, 2, 1);
  AddLost(261, 270);
  Add(271, 280, 1, 1);
  const Recall recall = FindRelocalisationRecall(frames_, {Event(255, "merged", 1, 2)}, shared_view_);
  EXPECT_EQ(recall.taken, 1u);
}

}  // namespace
}  // namespace haustra::evaluate
