// A run that was made by geometry, as the page gets it: two maps, a merge, a relocalisation, rejected candidates.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "tests/tools/evaluate/synthetic_run.h"
#include "tools/evaluate/evaluate_run.h"
#include "tools/report/page.h"

namespace haustra::report {

inline evaluate::RunEventRow EventWith(std::int64_t frame_idx, const char* name, int map_id, int other_map_id,
                                       std::string details) {
  evaluate::RunEventRow event = evaluate::Event(frame_idx, name, map_id, other_map_id);
  event.details = std::move(details);
  event.other_keyframe_id = DetailOf(event, "other_keyframe");
  return event;
}

// 60 frames: 0 to 4 initialising, 5 to 24 in map 0, 25 to 29 lost, 30 to 49 in map 1 (merged into 0 at 49), 50 to 54
// lost, 55 to 59 in map 0 again.
inline evaluate::RunOutput SmallRun() {
  evaluate::RunOutput run;
  run.folder = "results/small";
  for (std::int64_t i = 0; i < 60; ++i) {
    const int live = i < 5 ? -1 : i < 25 ? 0 : i < 30 ? -1 : i < 50 ? 1 : i < 55 ? -1 : 0;
    SE3 believed = evaluate::TruePose(i);
    believed.translation.z() += i % 2 == 0 ? 0.1 : -0.1;
    run.frames.push_back(evaluate::MakeRunFrame(i, live, live >= 0 ? 0 : -1, believed));
    run.frames.back().state = i < 5 ? "initialising" : live < 0 ? "lost" : "tracking";
    run.frames.back().timestamp_ns += 1000000000;  // videos do not begin at 0
    run.times.push_back({i, "tracking/total", 20.0 + static_cast<double>(i)});
  }
  run.times.push_back({49, "merging/total", 123.25});
  run.maps = {{0, "active", 12, 300}, {1, "merged", 0, 0}};
  run.events = {
      EventWith(5, "map_created", 0, -1, "2 keyframes 60 points"),
      EventWith(25, "lost", 0, -1, "few_matches"),
      EventWith(33, "merge_rejected", 1, 0, "no_similarity keyframe=6 other_keyframe=2 votes=20 matches=40"),
      EventWith(35, "merge_rejected", 1, 0,
                "no_similarity keyframe=7 other_keyframe=3 votes=21 matches=41 other_frame=9"),
      EventWith(40, "merge_rejected", 1, 1, "low_spread keyframe=8 other_keyframe=5 votes=22 matches=42"),
      EventWith(49, "merged", 0, 1, "accepted keyframe=9 other_keyframe=1 votes=30 matches=90 other_frame=6"),
      EventWith(52, "frame_not_found", 0, -1, "few_inliers keyframe=4 votes=9 matches=15"),
      EventWith(55, "relocalised", 0, -1, "50 inliers"),
  };
  run.figures.mode = "sequential";
  run.figures.device = "cpu";
  run.figures.seed = 7;
  run.figures.realtime_ratio = 1.25;
  run.figures.frame_ms = evaluate::Percentiles{21.5, 33.0, 40.0, 41.0};
  return run;
}

// Two marks on the wall of map 0, one of an earlier run, with a label that is HTML; and one that was refused.
inline evaluate::RunMarks SmallMarks() {
  evaluate::RunMarks marks;
  marks.set = {{"<b>&\"x", 0, Eigen::Vector3d(0.25, 0.5, 1.5), 1, 8, true}, {"old", 0, std::nullopt, 0, 120, false}};
  marks.refused = {{"<i>late", 70, "the run ended before its frame came"}};
  marks.sightings = {{9, 0, "in_front", 1.5},    {9, 1, "out_of_view", 4.0}, {10, 0, "unsure", 1.25},
                     {11, 0, "hidden", 1.0},     {12, 0, "hidden", 0.75},    {56, 0, "in_front", 2.5},
                     {56, 1, "out_of_view", 3.0}};
  return marks;
}

inline evaluate::Reference ShiftedReference(std::int64_t num_frames) {
  evaluate::Reference reference = evaluate::TrueReference(num_frames);
  for (GroundTruthPose& pose : reference.poses) pose.timestamp_ns += 1000000000;
  return reference;
}

// What stands between the tags of <script id="...">.
inline std::string ScriptText(const std::string& page, const std::string& id) {
  const std::string tag = "<script type=\"application/json\" id=\"" + id + "\">";
  const std::size_t begin = page.find(tag);
  if (begin == std::string::npos) return {};
  const std::size_t end = page.find("</script>", begin);
  return page.substr(begin + tag.size(), end - begin - tag.size());
}

}  // namespace haustra::report
