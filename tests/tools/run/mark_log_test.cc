#include "tools/run/mark_log.h"

#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>

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
  MarkLog log(*engine, {request});
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

}  // namespace
}  // namespace haustra
