#include "tools/evaluate/join_judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/evaluate/synthetic_run.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

// Map 1 in the first round, map 2 at the same places in the second; they were merged at the end, where `displace` says
// how the second lies in the frame of the first.
std::vector<EvaluatedFrame> TwoRounds(const Sim3& displace, double sigma = 0.1) {
  Jitter jitter(sigma);
  std::vector<EvaluatedFrame> frames;
  for (int i = 20; i < 120; ++i) frames.push_back(MakeFrame(i, 1, 1, jitter(TruePose(i))));
  for (int i = 120; i < 220; ++i) frames.push_back(LostFrame(i));
  for (int i = 220; i < 320; ++i) frames.push_back(MakeFrame(i, 2, 1, jitter(Moved(displace, TruePose(i)))));
  return frames;
}

JoinEvaluation JudgeOne(const std::vector<EvaluatedFrame>& frames, const RunEventRow& event,
                        const JoinOptions& options = {}) {
  const std::vector<JoinEvaluation> joins = JudgeJoins(frames, {event}, options);
  EXPECT_EQ(joins.size(), 1u);
  return joins.at(0);
}

Sim3 Shift(double x, double y, double z) { return Sim3(1.0, Eigen::Quaterniond::Identity(), {x, y, z}); }

// A turn that leaves `centre` where it is.
Sim3 TurnAbout(const Eigen::Vector3d& centre, double degrees) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, Eigen::Vector3d::UnitZ()));
  return Sim3(1.0, turn, centre - turn * centre);
}

TEST(JudgeMerge, TrueMergeIsTrue) {
  const JoinEvaluation join = JudgeOne(TwoRounds(Sim3()), Event(319, "merged", 1, 2));
  EXPECT_EQ(join.kind, JoinKind::kMerge);
  EXPECT_EQ(join.verdict, Verdict::kTrue) << join.reason;
  ASSERT_TRUE(join.ate_parts && join.ate_joined && join.rotation_error_deg && join.translation_error_depths);
  EXPECT_NEAR(*join.ate_parts, 0.1 * std::sqrt(3.0), 0.02);
  EXPECT_NEAR(*join.ate_joined, 0.1 * std::sqrt(3.0), 0.02);
  EXPECT_LT(*join.rotation_error_deg, 1e-3);
  EXPECT_LT(*join.translation_error_depths, 0.02);
}

TEST(JudgeMerge, OrderOfTheMapsInTheEventDoesNotMatter) {
  EXPECT_EQ(JudgeOne(TwoRounds(Sim3()), Event(319, "merged", 2, 1)).verdict, Verdict::kTrue);
  EXPECT_EQ(JudgeOne(TwoRounds(Shift(20, 0, 0)), Event(319, "merged", 2, 1)).verdict, Verdict::kFalse);
}

TEST(JudgeMerge, DisplacedPartIsFalse) {
  const JoinEvaluation join = JudgeOne(TwoRounds(Shift(0.0, 0.0, 0.5 * kDepth)), Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_NEAR(*join.translation_error_depths, 0.5, 0.02);
  EXPECT_THAT(join.reason, HasSubstr("one Sim(3)"));
  EXPECT_THAT(join.reason, HasSubstr("relative position"));
}

TEST(JudgeMerge, DisplacementBelowTheLimitsIsFalseByTheErrorAlone) {
  // 5 % of the depth: far below the limit of 20 %, but ten times the error of the parts.
  const JoinEvaluation join = JudgeOne(TwoRounds(Shift(0.0, 0.0, 0.05 * kDepth)), Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_EQ(join.reason, "the parts do not fit one Sim(3)");
  EXPECT_NEAR(*join.translation_error_depths, 0.05, 0.01);
}

TEST(JudgeMerge, ErrorBelowAHundredthOfTheDepthIsNoFault) {
  // The parts are nearly exact, so that any seam is thousands of times their error.
  const auto merge = [](double shift) {
    return JudgeOne(TwoRounds(Shift(0.0, 0.0, shift), 1e-6), Event(319, "merged", 1, 2));
  };
  const JoinEvaluation below = merge(0.55), above = merge(0.65);
  EXPECT_EQ(below.verdict, Verdict::kTrue) << below.reason;
  EXPECT_DOUBLE_EQ(*below.ate_joined_depths, *below.ate_joined / kDepth);
  EXPECT_NEAR(*below.ate_joined_depths, 0.0092, 3e-4);
  EXPECT_EQ(above.verdict, Verdict::kFalse);
  EXPECT_EQ(above.reason, "the parts do not fit one Sim(3)");
  EXPECT_NEAR(*above.ate_joined_depths, 0.0108, 3e-4);
}

TEST(JudgeMerge, SmallErrorsAreFaultsWhereTheDepthIsNotKnown) {
  std::vector<EvaluatedFrame> frames = TwoRounds(Shift(0.0, 0.0, 0.1), 1e-6);
  for (EvaluatedFrame& frame : frames) frame.depth = 0.0;
  EXPECT_EQ(JudgeOne(frames, Event(319, "merged", 1, 2)).verdict, Verdict::kFalse);
}

TEST(JudgeMerge, RoundingIsNoError) {
  const JoinEvaluation join = JudgeOne(TwoRounds(Sim3(), 0.0), Event(319, "merged", 1, 2));
  EXPECT_LT(*join.ate_joined, 1e-9);
  EXPECT_EQ(join.verdict, Verdict::kTrue) << join.reason;
}

TEST(JudgeMerge, ThreeTimesTheErrorOfThePartsIsTheLimit) {
  // Both parts 0.5 mm off, alternately; the shift between them does the rest: joined = sqrt(parts^2 + (shift/2)^2) at
  // most, so 2 x sqrt(8) x parts is what reaches the limit.
  const auto merge = [](double shift) {
    std::vector<EvaluatedFrame> frames;
    for (int i = 20; i < 320; ++i) {
      if (i >= 120 && i < 220) continue;
      SE3 believed = TruePose(i);
      believed.translation.z() += (i % 2 == 0 ? 0.5 : -0.5) + (i < 120 ? 0.0 : shift);
      frames.push_back(MakeFrame(i, i < 120 ? 1 : 2, 1, believed));
    }
    return JudgeOne(frames, Event(319, "merged", 1, 2));
  };
  const JoinEvaluation below = merge(2.75), above = merge(3.00);
  EXPECT_EQ(below.verdict, Verdict::kTrue) << *below.ate_joined / *below.ate_parts;
  EXPECT_NEAR(*below.ate_joined / *below.ate_parts, 2.93, 0.05);
  EXPECT_EQ(above.verdict, Verdict::kFalse) << *above.ate_joined / *above.ate_parts;
}

TEST(JudgeMerge, TurnedPartIsFalse) {
  const JoinEvaluation join =
      JudgeOne(TwoRounds(TurnAbout(TruePose(270).translation, 15.0)), Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_NEAR(*join.rotation_error_deg, 15.0, 1e-3);
  EXPECT_THAT(join.reason, HasSubstr("relative rotation"));
}

TEST(JudgeMerge, PartOfTheWrongScaleIsFalse) {
  const Eigen::Vector3d centre = TruePose(270).translation;
  const Sim3 grown(1.4, Eigen::Quaterniond::Identity(), centre - 1.4 * centre);
  const JoinEvaluation join = JudgeOne(TwoRounds(grown), Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_THAT(join.reason, HasSubstr("one Sim(3)"));
}

TEST(JudgeMerge, ShortPartIsJudgedByItsRelativePose) {
  const auto frames_with = [](const Sim3& displace) {
    std::vector<EvaluatedFrame> frames;
    for (int i = 20; i < 120; ++i) frames.push_back(MakeFrame(i, 1, 1, TruePose(i)));
    for (int i = 260; i < 266; ++i) frames.push_back(MakeFrame(i, 2, 1, Moved(displace, TruePose(i))));
    return frames;
  };
  EXPECT_EQ(JudgeOne(frames_with(Sim3()), Event(265, "merged", 1, 2)).verdict, Verdict::kTrue);
  const JoinEvaluation join = JudgeOne(frames_with(Shift(9.0, 0.0, 0.0)), Event(265, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_NEAR(*join.translation_error_depths, 0.3, 0.01);
}

TEST(JudgeMerge, FramesAfterTheMergeDoNotCount) {
  std::vector<EvaluatedFrame> frames = TwoRounds(Sim3());
  for (int i = 320; i < 360; ++i) frames.push_back(MakeFrame(i, 1, 1, Moved(Shift(40, 0, 0), TruePose(i))));
  EXPECT_EQ(JudgeOne(frames, Event(319, "merged", 1, 2)).verdict, Verdict::kTrue);
}

TEST(JudgeMerge, MapThatWasDroppedLaterCannotBeJudged) {
  std::vector<EvaluatedFrame> frames = TwoRounds(Sim3());
  for (EvaluatedFrame& frame : frames) {
    if (frame.live_map_id == 2) frame.map_id = -1;
  }
  const JoinEvaluation join = JudgeOne(frames, Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kUnjudged);
  EXPECT_THAT(join.reason, HasSubstr("no frame with a final and a true pose"));
}

TEST(JudgeMerge, FramesWithoutATruePoseAreNotUsed) {
  std::vector<EvaluatedFrame> frames = TwoRounds(Sim3());
  for (EvaluatedFrame& frame : frames) frame.truth.reset();
  EXPECT_EQ(JudgeOne(frames, Event(319, "merged", 1, 2)).verdict, Verdict::kUnjudged);
}

TEST(JudgeMerge, WithoutDepthTheErrorAloneDecides) {
  std::vector<EvaluatedFrame> right = TwoRounds(Sim3()), wrong = TwoRounds(Shift(0, 0, 15));
  for (EvaluatedFrame& frame : right) frame.depth = 0.0;
  for (EvaluatedFrame& frame : wrong) frame.depth = 0.0;
  EXPECT_EQ(JudgeOne(right, Event(319, "merged", 1, 2)).verdict, Verdict::kTrue);
  const JoinEvaluation join = JudgeOne(wrong, Event(319, "merged", 1, 2));
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_FALSE(join.translation_error_depths.has_value());
}

TEST(JudgeMerge, SecondMergeIsJudgedWithAllThatTheFirstJoined) {
  // Map 3 is displaced; the merge of 1 and 2 stays true, that of 3 with them is false, whichever of the two it names.
  std::vector<EvaluatedFrame> frames = TwoRounds(Sim3());
  for (int i = 420; i < 520; ++i) frames.push_back(MakeFrame(i, 3, 1, Moved(Shift(0, 0, 20), TruePose(i))));
  for (const int named : {1, 2}) {
    const std::vector<JoinEvaluation> joins =
        JudgeJoins(frames, {Event(319, "merged", 1, 2), Event(519, "merged", named, 3)}, {});
    ASSERT_EQ(joins.size(), 2u);
    EXPECT_EQ(joins[0].verdict, Verdict::kTrue) << joins[0].reason;
    EXPECT_EQ(joins[1].verdict, Verdict::kFalse);
  }
}

TEST(JudgeMerge, UntrustedOrientationsAreNotCompared) {
  std::vector<EvaluatedFrame> frames = TwoRounds(Sim3());
  const Eigen::Quaterniond wrong(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitX()));
  for (EvaluatedFrame& frame : frames) {
    if (frame.live_map_id == 2) frame.truth->rotation = frame.truth->rotation * wrong;
  }
  EXPECT_EQ(JudgeOne(frames, Event(319, "merged", 1, 2)).verdict, Verdict::kFalse);
  JoinOptions options;
  options.positions_only = true;
  const JoinEvaluation join = JudgeOne(frames, Event(319, "merged", 1, 2), options);
  EXPECT_EQ(join.verdict, Verdict::kTrue) << join.reason;
  EXPECT_FALSE(join.rotation_error_deg.has_value());
}

// Map 1, a loss, and tracking again in map 1 from frame 240 on.
std::vector<EvaluatedFrame> Relocalised(const Sim3& displace, int num_after = 40) {
  Jitter jitter(0.1);
  std::vector<EvaluatedFrame> frames;
  for (int i = 20; i < 120; ++i) frames.push_back(MakeFrame(i, 1, 1, jitter(TruePose(i))));
  for (int i = 120; i < 240; ++i) frames.push_back(LostFrame(i));
  for (int i = 240; i < 240 + num_after; ++i) {
    frames.push_back(MakeFrame(i, 1, 1, jitter(Moved(displace, TruePose(i)))));
  }
  return frames;
}

TEST(JudgeRelocalisation, RightPlaceIsTrue) {
  const JoinEvaluation join = JudgeOne(Relocalised(Sim3()), Event(240, "relocalised", 1));
  EXPECT_EQ(join.kind, JoinKind::kRelocalisation);
  EXPECT_EQ(join.verdict, Verdict::kTrue) << join.reason;
}

TEST(JudgeRelocalisation, WrongPlaceIsFalse) {
  EXPECT_EQ(JudgeOne(Relocalised(Shift(12, 0, 0)), Event(240, "relocalised", 1)).verdict, Verdict::kFalse);
  EXPECT_EQ(JudgeOne(Relocalised(Shift(12, 0, 0), 3), Event(240, "relocalised", 1)).verdict, Verdict::kFalse);
}

TEST(JudgeRelocalisation, WhatComesAfterTheNextLossDoesNotCount) {
  std::vector<EvaluatedFrame> frames = Relocalised(Sim3());
  frames.push_back(LostFrame(280));
  for (int i = 281; i < 300; ++i) frames.push_back(MakeFrame(i, 1, 1, Moved(Shift(25, 0, 0), TruePose(i))));
  const std::vector<JoinEvaluation> joins =
      JudgeJoins(frames, {Event(240, "relocalised", 1), Event(281, "relocalised", 1)}, {});
  ASSERT_EQ(joins.size(), 2u);
  EXPECT_EQ(joins[0].verdict, Verdict::kTrue) << joins[0].reason;
  EXPECT_EQ(joins[1].verdict, Verdict::kFalse);
}

// Map 1 over a round and a half without a loss; from frame 200 on it is displaced.
std::vector<EvaluatedFrame> Recovered(const Sim3& displace, const std::vector<int>& recovered) {
  Jitter jitter(0.1);
  std::vector<EvaluatedFrame> frames;
  for (int i = 0; i < 300; ++i) {
    frames.push_back(MakeFrame(i, 1, 1, jitter(i < 200 ? TruePose(i) : Moved(displace, TruePose(i)))));
  }
  for (const int i : recovered) frames[static_cast<std::size_t>(i)].is_recovered = true;
  return frames;
}

TEST(JudgeRecovery, IsJudgedLikeARelocalisation) {
  const std::vector<JoinEvaluation> right = JudgeJoins(Recovered(Sim3(), {200}), {}, {});
  ASSERT_EQ(right.size(), 1u);
  EXPECT_EQ(right[0].kind, JoinKind::kRecovery);
  EXPECT_EQ(right[0].frame_idx, 200);
  EXPECT_EQ(right[0].map_id, 1);
  EXPECT_EQ(right[0].verdict, Verdict::kTrue) << right[0].reason;
  const std::vector<JoinEvaluation> wrong = JudgeJoins(Recovered(Shift(0, 0, 12), {200}), {}, {});
  ASSERT_EQ(wrong.size(), 1u);
  EXPECT_EQ(wrong[0].verdict, Verdict::kFalse);
}

TEST(JudgeRecovery, NeighbouringFramesAreOneAndStandInOrderWithTheEvents) {
  const std::vector<JoinEvaluation> joins =
      JudgeJoins(Recovered(Sim3(), {100, 101, 102, 250}), {Event(200, "relocalised", 1)}, {});
  ASSERT_EQ(joins.size(), 3u);
  EXPECT_EQ(joins[0].frame_idx, 100);
  EXPECT_EQ(joins[1].kind, JoinKind::kRelocalisation);
  EXPECT_EQ(joins[2].frame_idx, 250);
}

// One map over a round and a half; the half is displaced against the round.
std::vector<EvaluatedFrame> Looped(const Sim3& displace) {
  Jitter jitter(0.1);
  std::vector<EvaluatedFrame> frames;
  for (int i = 0; i < 300; ++i) {
    frames.push_back(MakeFrame(i, 1, 1, jitter(i < 150 ? TruePose(i) : Moved(displace, TruePose(i)))));
  }
  return frames;
}

TEST(JudgeLoop, RightLoopIsTrueAndWrongLoopIsFalse) {
  const RunEventRow event = Event(299, "loop_closed", 1);
  EXPECT_EQ(JudgeOne(Looped(Sim3()), event).kind, JoinKind::kLoop);
  EXPECT_EQ(JudgeOne(Looped(Sim3()), event).verdict, Verdict::kTrue);
  const JoinEvaluation join = JudgeOne(Looped(Shift(0, 0, 10)), event);
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  // Not the frames on both sides of the cut are compared, which are neighbours in any case.
  EXPECT_NEAR(*join.translation_error_depths, 1.0 / 3, 0.02);
}

TEST(JudgeLoop, PartsAreCountedFromTheKeyframeThatWasMetAgain) {
  // 90 frames elsewhere, then a round and a half of which the half is displaced.
  std::vector<EvaluatedFrame> frames;
  for (int i = 110; i < 200; ++i) frames.push_back(MakeFrame(i, 1, 1, TruePose(i)));
  for (int i = 200; i < 500; ++i) {
    frames.push_back(MakeFrame(i, 1, 1, i < 400 ? TruePose(i) : Moved(Shift(0, 0, 10), TruePose(i))));
  }
  for (EvaluatedFrame& frame : frames) frame.keyframe_id = frame.frame_idx / 10;
  RunEventRow event = Event(499, "loop_closed", 1);
  event.other_keyframe_id = 20;
  const JoinEvaluation join = JudgeOne(frames, event);
  EXPECT_EQ(join.verdict, Verdict::kFalse);
  EXPECT_NEAR(*join.translation_error_depths, 1.0 / 3, 0.02);
}

TEST(JudgeJoins, OtherEventsAreNoJoins) {
  EXPECT_TRUE(JudgeJoins(TwoRounds(Sim3()), {Event(5, "map_created", 1), Event(9, "lost", 1)}, {}).empty());
}

}  // namespace
}  // namespace haustra::evaluate
