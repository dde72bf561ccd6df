#include "tools/run/mark_log.h"

#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <tuple>

#include "hal/fakes/manual_clock.h"
#include "tests/tools/run/scripted_colon.h"
#include "tools/run/run_summary.h"

namespace haustra {
namespace {

// The place of a mark in the summary is that of the wall behind the pixel, in the map that the poses of the run are in.
TEST(MarkLog, SummarySaysWhereTheMarkLiesAtTheEnd) {
  constexpr std::uint32_t kMarkedFrame = 30;
  const Eigen::Vector2d pixel(200.0, 150.0);
  test::ScriptedColon colon;
  colon.Move(0.0, 2.4, 60);
  const auto engine = colon.MakeEngine();
  MarkRequest request;
  request.frame_index = kMarkedFrame;
  request.pixel = pixel;
  request.label = *MarkLabel::From("polyp");
  MarkLog log(*engine, {request}, {});
  RunRecord record({});
  ASSERT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), record, test::kNeverStop, log).ok());
  log.Finish();
  RunSummary summary;
  SummariseMarks(log, *engine, &summary);
  ASSERT_EQ(summary.marks.size(), 1u) << (log.refused().empty() ? "" : log.refused()[0].reason);

  const FinalPose of_marked = ResolveAll(record, *engine)[kMarkedFrame];
  ASSERT_TRUE(of_marked.is_localised);
  const nlohmann::json mark = nlohmann::json::parse(ToJson(summary))["marks"]["set"][0];
  EXPECT_EQ(mark["label"], "polyp");
  EXPECT_EQ(mark["frame_idx"], kMarkedFrame);
  EXPECT_EQ(mark["map_id"], of_marked.pose.map_id);
  const auto position = mark["position"].get<std::vector<double>>();
  ASSERT_EQ(position.size(), 3u);
  Eigen::Vector2d seen;
  ASSERT_TRUE(colon.camera().Project(of_marked.pose.cam_from_map * Eigen::Vector3d::Map(position.data()), &seen));
  EXPECT_LT((seen - pixel).norm(), 3.0) << seen.transpose();
}

// Frames and pixels are those of the recording: of a part of it, halved, the mark lies on the same wall.
TEST(MarkLog, MarksAreThoseOfTheRecordingWhateverPartOfItIsRead) {
  test::ScriptedColon colon;
  colon.Move(0.0, 2.4, 60);
  const auto engine = colon.MakeEngine();
  const auto request = [](std::uint32_t frame, const char* label) {
    MarkRequest mark;
    mark.frame_index = frame;
    mark.pixel = Eigen::Vector2d(400.5, 300.5);  // 200, 150 of the halved picture
    mark.label = *MarkLabel::From(label);
    return mark;
  };
  SequenceOptions part;
  part.first_frame = 100;
  part.last_frame = 400;
  part.every_nth = 2;
  part.halve = true;
  MarkLog log(*engine,
              {request(30, "before"), request(160, "read"), request(161, "between"), request(300, "late"),
               request(402, "after")},
              part);
  RunRecord record({});
  ASSERT_TRUE(RunSequential(colon.source(), *engine, ManualClock(), record, test::kNeverStop, log).ok());
  log.Finish();
  RunSummary summary;
  SummariseMarks(log, *engine, &summary);
  ASSERT_EQ(summary.marks.size(), 1u);
  EXPECT_EQ(summary.marks[0].label, "read");
  EXPECT_EQ(summary.marks[0].frame_index, 30u);
  const FinalPose of_marked = ResolveAll(record, *engine)[30];
  Eigen::Vector2d seen;
  ASSERT_TRUE(colon.camera().Project(of_marked.pose.cam_from_map * summary.marks[0].position, &seen));
  EXPECT_LT((seen - Eigen::Vector2d(200.0, 150.0)).norm(), 3.0) << seen.transpose();
  ASSERT_EQ(summary.refused_marks.size(), 4u);
  for (const auto& [i, frame, reason] : {std::tuple{0, 30u, "the run does not read its frame"},
                                         {1, 161u, "the run does not read its frame"},
                                         {2, 402u, "the run does not read its frame"},
                                         {3, 300u, "the run ended before its frame came"}}) {
    EXPECT_EQ(summary.refused_marks[i].frame_index, frame);
    EXPECT_EQ(summary.refused_marks[i].reason, reason);
  }
}

}  // namespace
}  // namespace haustra
