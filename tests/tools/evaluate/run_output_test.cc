#include "tools/evaluate/run_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "tests/tools/evaluate/run_folder.h"

namespace haustra::evaluate {
namespace {

using ::testing::HasSubstr;

class RunOutputTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (std::int64_t i = 0; i < 30; ++i) {
      const int map_id = i < 5 ? -1 : i < 20 ? 1 : 2;
      run_.frames.push_back(MakeRunFrame(i, map_id, map_id, TruePose(i)));
    }
    run_.maps = {{1, "stored", 5, 100}, {2, "active", 6, 120}};
    run_.events = {Event(20, "relocalised", 1), Event(5, "map_created", 1)};
    WriteRunFolder(folder_, "out", run_);
  }
  Result<RunOutput> Read() { return ReadRunOutput(folder_.At("out")); }
  // Replaces one text in one file of the folder.
  void Edit(const std::string& file, const std::string& from, const std::string& to) {
    std::string text = folder_.Read("out/" + file);
    const std::size_t position = text.find(from);
    ASSERT_NE(position, std::string::npos) << from;
    folder_.Write("out/" + file, text.replace(position, from.size(), to));
  }

  TextFolder folder_;
  RunOutput run_;
};

TEST_F(RunOutputTest, EverythingComesBack) {
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  ASSERT_EQ(run->frames.size(), 30u);
  EXPECT_EQ(run->frames[4].map_id, -1);
  EXPECT_EQ(run->frames[29].map_id, 2);
  EXPECT_EQ(run->frames[29].timestamp_ns, 29 * kPeriodNs);
  const SE3& expected = run_.frames[10].world_from_cam;
  EXPECT_LT((run->frames[10].world_from_cam.translation - expected.translation).norm(), 1e-12);
  EXPECT_LT(RotationAngle(run->frames[10].world_from_cam.rotation, expected.rotation), 1e-7);
  ASSERT_EQ(run->maps.size(), 2u);
  EXPECT_EQ(run->maps[1].num_points, 120);
  EXPECT_EQ(run->maps[1].merged_into, -1);
  EXPECT_FALSE(run->figures.sequence_frames.has_value());
  ASSERT_EQ(run->events.size(), 2u);
  EXPECT_EQ(run->events[0].event, "map_created");
  EXPECT_EQ(run->events[1].other_keyframe_id, 3);
  EXPECT_EQ(run->figures.mode, "sequential");
  EXPECT_EQ(run->figures.seed, 3);
  EXPECT_EQ(run->figures.frame_ms->p99, 33.0);
  EXPECT_EQ(run->figures.peak_rss_mb, 512.5);
  EXPECT_EQ(run->figures.mean_stage_ms.at("bundle"), 80.5);
  EXPECT_EQ(DetailOf(run->events[1], "votes"), 12);
  EXPECT_EQ(DetailOf(run->events[1], "keyframe"), 9);
  EXPECT_FALSE(DetailOf(run->events[1], "frame").has_value());
  EXPECT_EQ(run->frames[4].state, "lost");
  EXPECT_TRUE(run->times.empty());
  EXPECT_TRUE(run->geometry.empty());
  EXPECT_TRUE(run->warnings.empty());
}

TEST_F(RunOutputTest, FrameThatNoSequenceHasIsRefused) {
  Edit("frames.csv", "\n29,", "\n4294967295,");
  EXPECT_EQ(Read().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv:31: frame_idx is 4294967295, not from 0 to 100000000"));
}

TEST_F(RunOutputTest, PartOfTheSequenceIsRead) {
  Edit("summary.json", "\"frames\": 30", "\"first_frame\": 100, \"every_nth\": 2, \"frames\": 30");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  EXPECT_EQ(run->figures.part.StoredFrame(3), 106);
  Edit("summary.json", "\"every_nth\": 2", "\"every_nth\": 0");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: every_nth is 0"));
}

TEST_F(RunOutputTest, MotionsOfScopeAgainstWallAreRead) {
  EXPECT_TRUE(Read()->figures.motions.empty()) << "of a run that did not look for them";
  Edit("summary.json", "\"frames\": 30",
       R"("periodic_motion": [{"map_id": 2, "longest_period_s": 6.5, "found": [
            {"from_s": 1.5, "to_s": 61.5, "period_s": 3.75, "amplitude_percent": 4.25, "chance": 1e-05}]},
          {"map_id": 3, "longest_period_s": 0.0, "found": []}], "frames": 30)");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  ASSERT_EQ(run->figures.motions.size(), 2u);
  const MapMotionRow& motion = run->figures.motions[0];
  EXPECT_EQ(motion.map_id, 2);
  EXPECT_EQ(motion.longest_period_s, 6.5);
  ASSERT_EQ(motion.found.size(), 1u);
  EXPECT_EQ(motion.found[0].from_s, 1.5);
  EXPECT_EQ(motion.found[0].to_s, 61.5);
  EXPECT_EQ(motion.found[0].period_s, 3.75);
  EXPECT_EQ(motion.found[0].amplitude_percent, 4.25);
  EXPECT_EQ(motion.found[0].chance, 1e-5);
  EXPECT_TRUE(run->figures.motions[1].found.empty());
  Edit("summary.json", "\"period_s\": 3.75", "\"period_s\": \"long\"");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: periodic_motion: "));
}

TEST_F(RunOutputTest, AMapThatHasLostItsScaleIsAWarning) {
  Edit("summary.json", "\"frames\": 30",
       R"("scene_depth": [
            {"map_id": 1, "keyframes": 40, "p5": 0.5, "p50": 1.0, "p95": 2.0, "scale_lost": false},
            {"map_id": 2, "keyframes": 40, "p5": 0.002, "p50": 0.1, "p95": 1.0, "scale_lost": true}], "frames": 30)");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  ASSERT_EQ(run->warnings.size(), 1u);
  EXPECT_THAT(run->warnings[0], HasSubstr("map 2 has lost its scale: what it sees is 500 times as far away"));
  Edit("summary.json", "\"p5\": 0.002", "\"p5\": 0");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: scene_depth: p5 and p95 of map 2 are no depths"));
  Edit("summary.json", "\"p5\": 0,", "\"p5\": \"near\",");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: scene_depth: "));
}

TEST_F(RunOutputTest, LengthOfTheSequenceAndWhatMapsWereMergedIntoAreRead) {
  Edit("summary.json", "\"frames\": 30", "\"frames\": 30, \"sequence_frames\": 45");
  Edit("maps.csv", "1,stored,-1", "1,merged,2");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  EXPECT_EQ(run->figures.sequence_frames, 45);
  EXPECT_EQ(run->figures.part.StoredFrame(3), 3);
  EXPECT_EQ(run->maps[0].merged_into, 2);
  EXPECT_TRUE(run->warnings.empty());
}

TEST_F(RunOutputTest, TimesAreReadWhenTheyAreThere) {
  folder_.Write("out/times.csv", "frame_idx,stage,ms\n0,tracking/total,12.5\n3,mapping/bundle,80\n");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  ASSERT_EQ(run->times.size(), 2u);
  EXPECT_EQ(run->times[1].frame_idx, 3);
  EXPECT_EQ(run->times[1].stage, "mapping/bundle");
  EXPECT_EQ(run->times[0].ms, 12.5);
}

TEST_F(RunOutputTest, BadTimesAreNamedWithTheirLine) {
  folder_.Write("out/times.csv", "frame_idx,stage,ms\n0,tracking/total,12.5\n3,mapping/bundle,soon\n");
  EXPECT_EQ(Read().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(Read().status().message(), HasSubstr("times.csv:3: ms is 'soon'"));
  folder_.Write("out/times.csv", "frame_idx,stage,ms\n0,tracking/total,-1\n");
  EXPECT_THAT(Read().status().message(), HasSubstr("times.csv:2: ms is -1, below zero"));
}

TEST_F(RunOutputTest, MissingFolderIsNotFound) {
  const Result<RunOutput> run = ReadRunOutput(folder_.At("nowhere"));
  EXPECT_EQ(run.code(), StatusCode::kNotFound);
  EXPECT_THAT(run.status().message(), HasSubstr("nowhere: no such folder"));
}

TEST_F(RunOutputTest, FolderThatMayNotBeReadIsUnavailable) {
  if (geteuid() == 0) GTEST_SKIP() << "root may read everything";
  std::filesystem::permissions(folder_.At("out"), std::filesystem::perms::none);
  for (const char* name : {"out", "out/below"}) {
    const Result<RunOutput> run = ReadRunOutput(folder_.At(name));
    EXPECT_EQ(run.code(), StatusCode::kUnavailable) << name;
    EXPECT_THAT(run.status().message(), HasSubstr("Permission denied"));
  }
  std::filesystem::permissions(folder_.At("out"), std::filesystem::perms::owner_all);
}

TEST_F(RunOutputTest, MissingFilesAreNamed) {
  for (const char* file : {"frames.csv", "maps.csv", "events.csv", "summary.json", "trajectory/map_0002.tum"}) {
    WriteRunFolder(folder_, "out", run_);
    folder_.Remove(std::string("out/") + file);
    const Result<RunOutput> run = Read();
    EXPECT_EQ(run.code(), StatusCode::kNotFound) << file;
    EXPECT_THAT(run.status().message(), HasSubstr(file));
  }
}

TEST_F(RunOutputTest, MalformedFilesAreNamedWithTheirLine) {
  Edit("frames.csv", "\n3,", "\nthree,");
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv:5: frame_idx is 'three'"));
  WriteRunFolder(folder_, "out", run_);
  Edit("frames.csv", "\n3,", "\n2,");
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv:5: frame_idx 2 does not come after 2"));
  WriteRunFolder(folder_, "out", run_);
  Edit("maps.csv", "\n2,", "\n1,");
  EXPECT_THAT(Read().status().message(), HasSubstr("maps.csv:3: map_id 1 is there twice"));
  WriteRunFolder(folder_, "out", run_);
  Edit("events.csv", ",1,", ",one,");
  EXPECT_THAT(Read().status().message(), HasSubstr("events.csv:2: map_id is 'one'"));
  WriteRunFolder(folder_, "out", run_);
  Edit("summary.json", "\"mode\"", "mode");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: "));
  WriteRunFolder(folder_, "out", run_);
  Edit("summary.json", "\"p99\": 33.0,", "");
  EXPECT_THAT(Read().status().message(), HasSubstr("frame_ms lacks"));
  EXPECT_EQ(Read().code(), StatusCode::kInvalidArgument);
}

// They were cut to the size of what holds them, and another map was meant.
TEST_F(RunOutputTest, NumbersThatNoRunWritesAreRefused) {
  Edit("frames.csv", "\n3,", "\n-3,");
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv:5: frame_idx is -3, not from 0 to 100000000"));
  WriteRunFolder(folder_, "out", run_);
  Edit("frames.csv", "120000000", "9223372036854775807");
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv:5: timestamp_ns is 9223372036854775807, not from"));
  WriteRunFolder(folder_, "out", run_);
  Edit("frames.csv", ",1,1,", ",1,4294967297,");
  EXPECT_THAT(Read().status().message(), HasSubstr("map_id is 4294967297, not from -1 to 2147483647"));
  WriteRunFolder(folder_, "out", run_);
  Edit("maps.csv", "\n2,", "\n-2,");
  EXPECT_THAT(Read().status().message(), HasSubstr("maps.csv:3: map_id is -2, not from 0"));
  WriteRunFolder(folder_, "out", run_);
  Edit("summary.json", "\"frames\": 30",
       R"("periodic_motion": [{"map_id": 1e300, "longest_period_s": 0, "found": []}], "frames": 30)");
  EXPECT_THAT(Read().status().message(), HasSubstr("summary.json: periodic_motion: map_id is 1e+300"));
}

TEST_F(RunOutputTest, NumberThatDoesNotFitIsNotKnown) {
  Edit("summary.json", "\"frames\": 30",
       "\"first_frame\": -1, \"every_nth\": 1e300, \"deadline_misses\": -5, \"frames\": 30");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  EXPECT_FALSE(run->figures.deadline_misses.has_value());
  EXPECT_EQ(run->figures.part.StoredFrame(3), 3);
}

TEST_F(RunOutputTest, RunWithoutFramesIsRefused) {
  folder_.Write(
      "out/frames.csv",
      "frame_idx,timestamp_ns,state,reason,live_map_id,map_id,keyframe_id,num_matches,num_inliers,frame_ms\n");
  EXPECT_THAT(Read().status().message(), HasSubstr("frames.csv: no frames"));
}

// As when the table was cut: none of its frames would count.
TEST_F(RunOutputTest, FramesOfAMapThatTheTableLacksAreRefused) {
  const std::string maps = folder_.Read("out/maps.csv");
  folder_.Write("out/maps.csv", maps.substr(0, maps.find("\n2,") + 1));
  const Status status = Read().status();
  EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("maps.csv: map 2 is missing, into which frames.csv puts frames"));
}

TEST_F(RunOutputTest, FrameWithoutItsPoseIsNotLocalisedAndWarnedAbout) {
  std::string text = folder_.Read("out/trajectory/map_0002.tum");
  text.erase(text.rfind('\n', text.size() - 2) + 1);
  folder_.Write("out/trajectory/map_0002.tum", text);
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  EXPECT_EQ(run->frames[29].map_id, -1);
  EXPECT_EQ(run->frames[28].map_id, 2);
  ASSERT_EQ(run->warnings.size(), 1u);
  EXPECT_THAT(run->warnings[0], HasSubstr("no pose for 1 frames"));
}

TEST_F(RunOutputTest, SummaryOfAnotherRunIsWarnedAbout) {
  Edit("summary.json", "\"frames\": 30", "\"frames\": 31");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok());
  ASSERT_EQ(run->warnings.size(), 1u);
  EXPECT_THAT(run->warnings[0], HasSubstr("says 31 frames, frames.csv has 30"));
}

TEST_F(RunOutputTest, FiguresThatAreNotThereAreNotKnown) {
  folder_.Write("out/summary.json", "{\"peak_rss_mb\": null}");
  const Result<RunOutput> run = Read();
  ASSERT_TRUE(run.ok()) << run.status().ToString();
  EXPECT_FALSE(run->figures.peak_rss_mb.has_value());
  EXPECT_FALSE(run->figures.frame_ms.has_value());
  EXPECT_EQ(run->figures.mode, "");
}

}  // namespace
}  // namespace haustra::evaluate
