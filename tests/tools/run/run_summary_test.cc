#include "tools/run/run_summary.h"

#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "hal/fakes/manual_clock.h"
#include "tests/tools/run/scripted_colon.h"

namespace haustra {
namespace {

using std::chrono::milliseconds;
using test::ScriptedColon;

FrameOutcome OutcomeWithLatency(std::uint32_t index, Duration latency) {
  FrameOutcome outcome;
  outcome.result.frame_index = index;
  outcome.latency = latency;
  return outcome;
}

// Of a record alone: the engine has seen nothing.
RunSummary SummaryOf(const RunRecord& record, const SessionSummary& session = {}) {
  ScriptedColon colon;
  const auto engine = colon.MakeEngine();
  return Summarise(record, ResolveAll(record, *engine), *engine, session, 0);
}

TEST(RunSummary, PercentilesAreByNearestRank) {
  RunRecord record({});
  for (int i = 1; i <= 1000; ++i) record.OnFrame(OutcomeWithLatency(i, milliseconds((i * 617) % 1000 + 1)));
  const LatencyFigures figures = SummaryOf(record).frame_ms;
  EXPECT_EQ(figures.p50, 500.0);
  EXPECT_EQ(figures.p99, 990.0);
  EXPECT_EQ(figures.p999, 999.0);
  EXPECT_EQ(figures.max, 1000.0);
}

TEST(RunSummary, OneFrameIsEveryPercentile) {
  RunRecord record({});
  record.OnFrame(OutcomeWithLatency(0, milliseconds(7)));
  const LatencyFigures figures = SummaryOf(record).frame_ms;
  EXPECT_EQ(figures.p50, 7.0);
  EXPECT_EQ(figures.p999, 7.0);
  EXPECT_EQ(figures.max, 7.0);
}

TEST(RunSummary, DroppedAndDamagedFramesHaveNoLatency) {
  RunRecord record({});
  record.OnFrame(OutcomeWithLatency(0, milliseconds(10)));
  FrameOutcome dropped = OutcomeWithLatency(1, milliseconds(0));
  dropped.is_dropped = true;
  FrameOutcome damaged = OutcomeWithLatency(2, milliseconds(0));
  damaged.is_damaged = true;
  record.OnFrame(dropped);
  record.OnFrame(damaged);
  const RunSummary summary = SummaryOf(record);
  EXPECT_EQ(summary.frame_ms.p50, 10.0);
  EXPECT_EQ(summary.frames, 3u);
  EXPECT_EQ(summary.dropped, 1u);
  EXPECT_EQ(summary.damaged, 1u);
}

TEST(RunSummary, EmptyRunIsAllZero) {
  const RunSummary summary = SummaryOf(RunRecord({}));
  EXPECT_EQ(summary.frames, 0u);
  EXPECT_EQ(summary.coverage, 0.0);
  EXPECT_EQ(summary.maps, 0u);
  EXPECT_EQ(summary.realtime_ratio, 0.0);
  EXPECT_EQ(summary.frame_ms.max, 0.0);
}

TEST(RunSummary, CoverageIsOfTheWholeSequence) {
  ScriptedColon colon;
  const auto engine = colon.MakeEngine();
  RunRecord record({});
  for (int i = 0; i < 10; ++i) record.OnFrame(OutcomeWithLatency(i, milliseconds(1)));
  std::vector<FinalPose> poses(10);
  for (int i = 0; i < 5; ++i) poses[i].is_localised = true;
  const RunSummary whole = Summarise(record, poses, *engine, {}, 0);
  EXPECT_EQ(whole.sequence_frames, 10u);
  EXPECT_EQ(whole.coverage, 50.0);
  const RunSummary aborted = Summarise(record, poses, *engine, {}, 40);
  EXPECT_EQ(aborted.frames, 10u);
  EXPECT_EQ(aborted.sequence_frames, 40u);
  EXPECT_EQ(aborted.coverage, 12.5);
}

TEST(RunSummary, PoseInAMapThatIsGoneIsNoneThatLasts) {
  RunRecord record({});
  FrameOutcome tracked = OutcomeWithLatency(0, milliseconds(1));
  tracked.result.state = TrackingState::kTracking;
  tracked.result.map_id = 7;
  record.OnFrame(tracked);
  EXPECT_EQ(SummaryOf(record).live_localised, 0u);
}

TEST(RunSummary, RealTimeRatioIsWallTimeOverVideoTime) {
  const RunSummary summary = SummaryOf(RunRecord({}), {milliseconds(3000), milliseconds(2000)});
  EXPECT_EQ(summary.video_s, 2.0);
  EXPECT_EQ(summary.wall_s, 3.0);
  EXPECT_EQ(summary.realtime_ratio, 1.5);
}

// A sequential session over scripted frames with all that follows from it.
class ScriptedRun {
 public:
  explicit ScriptedRun(ScriptedColon& colon) : engine_(colon.MakeEngine()) {
    const auto session = RunSequential(colon.source(), *engine_, ManualClock(), record_, test::kNeverStop);
    EXPECT_TRUE(session.ok()) << session.status().ToString();
    poses_ = ResolveAll(record_, *engine_);
    summary_ = Summarise(record_, poses_, *engine_, *session, 0);
  }
  const RunRecord& record() const { return record_; }
  const std::vector<FinalPose>& poses() const { return poses_; }
  const RunSummary& summary() const { return summary_; }
  const Engine& engine() const { return *engine_; }

 private:
  RunRecord record_{{}};
  std::unique_ptr<Engine> engine_;
  std::vector<FinalPose> poses_;
  RunSummary summary_;
};

TEST(RunSummary, OccludedFramesAreNotLocalisedAndTheMapIsOne) {
  ScriptedColon colon;
  colon.Move(0.0, 3.0, 75);
  colon.Occlude(15);
  colon.Move(3.0, 4.0, 25);
  const ScriptedRun run(colon);
  const RunSummary& summary = run.summary();
  EXPECT_EQ(summary.frames, 115u);
  EXPECT_EQ(summary.maps, 1u);
  EXPECT_EQ(summary.maps_created, 1u);
  EXPECT_EQ(summary.losses, 1u);
  EXPECT_EQ(summary.relocalisations, 1u);
  EXPECT_EQ(summary.largest_map_frames, summary.localised);
  EXPECT_GE(summary.localised, 90u);
  EXPECT_LE(summary.localised, 100u);
  EXPECT_DOUBLE_EQ(summary.coverage, 100.0 * static_cast<double>(summary.localised) / 115.0);
  for (int i = 75; i < 90; ++i) EXPECT_FALSE(run.poses()[i].is_localised) << i;
  // Both views that founded the map, and those between them, were answered without a pose.
  EXPECT_LE(summary.live_localised, summary.localised - 2);
  EXPECT_GE(summary.live_localised, summary.localised / 2);
  EXPECT_DOUBLE_EQ(summary.live_coverage, 100.0 * static_cast<double>(summary.live_localised) / 115.0);
}

// The views that founded the map were answered as initialising; they have poses all the same in the end.
TEST(RunSummary, KeyframesAreLocalisedThoughTheyWereAnsweredWithoutAPose) {
  ScriptedColon colon;
  colon.Move(0.0, 2.0, 50);
  const ScriptedRun run(colon);
  int num_checked = 0;
  run.engine().atlas().keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) {
    const FinalPose& pose = run.poses()[keyframe.frame_index];
    ASSERT_TRUE(pose.is_localised) << keyframe.frame_index;
    num_checked += run.record().frames()[keyframe.frame_index].result.state == TrackingState::kInitialising;
  });
  EXPECT_EQ(num_checked, 2);
}

// Evaluation's definition: a map that was dropped for being too small takes its frames with it.
TEST(RunSummary, FramesOfADroppedMapAreNotLocalised) {
  ScriptedColon colon;
  colon.Move(0.0, 0.32, 8);
  colon.Occlude(10);
  colon.Move(12.0, 15.0, 75);
  const ScriptedRun run(colon);
  int num_dropped = 0;
  for (const RunEvent& event : run.record().events()) num_dropped += event.event == "map_dropped";
  ASSERT_EQ(num_dropped, 1) << "the first map must be too small for this test";
  std::size_t num_tracked_before = 0;
  for (int i = 0; i < 8; ++i) {
    num_tracked_before += run.record().frames()[i].result.state == TrackingState::kTracking;
    EXPECT_FALSE(run.poses()[i].is_localised) << i;
  }
  EXPECT_GT(num_tracked_before, 0u);
  EXPECT_EQ(run.summary().maps, 1u);
  EXPECT_EQ(run.summary().maps_created, 2u);
}

TEST(RunSummary, FramesOfAMergedMapAreLocalisedInTheOneThatIsLeft) {
  ScriptedColon colon;
  colon.Move(0.0, 4.0, 100);
  colon.Occlude(60);
  colon.Move(8.0, 3.0, 125);  // on unseen wall first, then back to what the first map holds
  const ScriptedRun run(colon);
  EXPECT_EQ(run.summary().merges, 1u);
  EXPECT_EQ(run.summary().maps, 1u);
  EXPECT_EQ(run.summary().maps_created, 2u);
  EXPECT_EQ(run.summary().largest_map_frames, run.summary().localised);
  MapId left = kNoId;
  for (const FinalPose& pose : run.poses()) {
    if (!pose.is_localised) continue;
    if (left == kNoId) left = pose.pose.map_id;
    EXPECT_EQ(pose.pose.map_id, left);
  }
}

TEST(RunSummary, JsonHasTheTermsOfTheEvaluation) {
  RunSummary summary;
  summary.mode = "sequential";
  summary.device = "cpu";
  summary.seed = 18446744073709551615u;
  summary.first_frame = 100;
  summary.every_nth = 2;
  summary.frames = 8;
  summary.localised = 6;
  summary.coverage = 75.0;
  summary.frame_ms = {1.0, 2.0, 3.0, 4.0};
  const nlohmann::json json = nlohmann::json::parse(ToJson(summary));
  for (const char* key :
       {"sequence_frames", "live_localised", "live_coverage", "frames", "localised", "coverage", "maps", "merges",
        "loops", "relocalisations", "largest_map_frames", "frame_ms", "dropped", "peak_rss_mb", "realtime_ratio"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(json["seed"].get<std::uint64_t>(), 18446744073709551615u);
  EXPECT_EQ(json["first_frame"], 100);
  EXPECT_EQ(json["every_nth"], 2);
  EXPECT_EQ(json["frame_ms"], (nlohmann::json{{"p50", 1.0}, {"p99", 2.0}, {"p999", 3.0}, {"max", 4.0}}));
}

// The progress counts them: at the end it is to be seen where they went.
TEST(RunSummary, PosesInMapsThatDidNotLastAreSaid) {
  RunSummary summary;
  summary.tracked = summary.live_localised = 113;
  EXPECT_EQ(ToText(summary).find("given up"), std::string::npos);
  summary.live_localised = 101;
  EXPECT_NE(ToText(summary).find("\n  given up         12     frames more had a pose at the time, in a map that did"),
            std::string::npos)
      << ToText(summary);
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["tracked"], 113);
}

TEST(RunSummary, TheSurfaceIsSaidWhereItWasAskedFor) {
  RunSummary summary;
  EXPECT_FALSE(nlohmann::json::parse(ToJson(summary)).contains("surface"));
  EXPECT_EQ(ToText(summary).find("wall"), std::string::npos);
  summary.surface = SurfaceFigures{"", R"([{"map_id": 3, "wall_coverage": 0.5}])", {"map 3: half of it\n"}};
  nlohmann::json surface = nlohmann::json::parse(ToJson(summary))["surface"];
  EXPECT_EQ(surface["made"], true);
  EXPECT_EQ(surface["maps"][0]["map_id"], 3);
  EXPECT_EQ(surface["maps"][0]["wall_coverage"], 0.5);
  EXPECT_NE(ToText(summary).find("\n  wall          map 3: half of it\n"), std::string::npos) << ToText(summary);
  summary.surface = SurfaceFigures{"the disk is full", "", {}};
  surface = nlohmann::json::parse(ToJson(summary))["surface"];
  EXPECT_EQ(surface, (nlohmann::json{{"made", false}, {"reason", "the disk is full"}}));
  EXPECT_NE(ToText(summary).find("\n  wall          no surface: the disk is full\n"), std::string::npos);
}

// Names of files are bytes, and errors tell them.
TEST(RunSummary, NameThatIsNotUtf8CostsNoSummary) {
  RunSummary summary;
  summary.surface = SurfaceFigures{"caf\xe9/surface: No space left on device", "", {}};
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["surface"]["reason"],
            "caf\xef\xbf\xbd/surface: No space left on device");
}

TEST(RunSummary, TheMotionOfTheWallIsSaidOrThatThereIsNone) {
  RunSummary summary;
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["periodic_motion"], nlohmann::json::array());
  EXPECT_EQ(ToText(summary).find("to and fro"), std::string::npos) << "nothing was looked for";
  summary.motions = {{0, {5.5, {}}}, {2, {0.0, {}}}};
  EXPECT_NE(ToText(summary).find("\n  to and fro     none     (scope against wall, with a period of 1.5 to 5.5 s)\n"),
            std::string::npos)
      << ToText(summary);
  summary.motions[1].motion = {8.0, {{3.0, 63.0, 4.5, 0.025, 0.0075}, {90.0, 150.25, 3.75, 0.0375, 0.0005}}};
  EXPECT_NE(ToText(summary).find(
                "\n  to and fro      3.8 s   (scope against wall, by 3.8 % of the depth, seen from 90 to 150 s)\n"),
            std::string::npos)
      << ToText(summary);
  const nlohmann::json json = nlohmann::json::parse(ToJson(summary))["periodic_motion"];
  ASSERT_EQ(json.size(), 2u);
  EXPECT_EQ(json[0], nlohmann::json::parse(R"({"map_id": 0, "longest_period_s": 5.5, "found": []})"));
  EXPECT_EQ(json[1]["map_id"], 2);
  EXPECT_EQ(json[1]["found"][1], nlohmann::json::parse(R"({"from_s": 90.0, "to_s": 150.25, "period_s": 3.75,
                                                          "amplitude_percent": 3.75, "chance": 0.0005})"));
}

// Between 5 and 100 mm from the wall the depth differs by a factor of 20.
TEST(RunSummary, AMapThatHasLostItsScaleIsNamed) {
  RunSummary summary;
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["scene_depth"], nlohmann::json::array());
  summary.scene_depths = {{0, 400, 0.25, 1.0, 4.75}, {3, 19, 0.001, 0.25, 1.0}};
  EXPECT_EQ(ToText(summary).find("scale"), std::string::npos) << "steady, and too few keyframes to tell";
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["scene_depth"],
            nlohmann::json::parse(R"([{"map_id": 0, "keyframes": 400, "p5": 0.25, "p50": 1.0, "p95": 4.75,
                                       "scale_lost": false},
                                      {"map_id": 3, "keyframes": 19, "p5": 0.001, "p50": 0.25, "p95": 1.0,
                                       "scale_lost": false}])"));
  summary.scene_depths[1].num_keyframes = 20;
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["scene_depth"][1]["scale_lost"], true);
  EXPECT_NE(ToText(summary).find(
                "\n  scale          lost     in map 3: what it sees is 1000 times as far away in one part as in"),
            std::string::npos)
      << ToText(summary);
  EXPECT_EQ(ToText(summary).find("map 0"), std::string::npos);
}

TEST(RunSummary, TextSaysWhatIsWrongOnlyWhenItIs) {
  RunSummary summary;
  summary.mode = "realtime";
  EXPECT_EQ(ToText(summary).find("dropped"), std::string::npos);
  EXPECT_EQ(ToText(summary).find("damaged"), std::string::npos);
  EXPECT_EQ(ToText(summary).find("heap"), std::string::npos);
  EXPECT_EQ(ToText(summary).find("interlaced"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["interlaced"], 0);
  summary.frames = 133;
  summary.interlaced = 77;
  EXPECT_NE(ToText(summary).find("interlaced       77     of 133 pictures: one field of each"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(ToJson(summary))["interlaced"], 77);
  summary.dropped = 3;
  summary.damaged = 2;
  summary.heap_growth_mb = 1.5;
  EXPECT_NE(ToText(summary).find("1.5 MB  more than was set aside"), std::string::npos);
  EXPECT_NE(ToText(summary).find("dropped"), std::string::npos);
  EXPECT_NE(ToText(summary).find("damaged"), std::string::npos);
}

}  // namespace
}  // namespace haustra
