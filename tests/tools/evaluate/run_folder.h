// Writes a run that was made by geometry into a folder, as haustra run does.
#pragma once

#include <nlohmann/json.hpp>

#include "engine/io/colmap_writer.h"
#include "engine/io/text_writer.h"
#include "engine/io/trajectory_writer.h"
#include "tests/tools/evaluate/synthetic_run.h"
#include "tests/tools/evaluate/text_folder.h"

namespace haustra::evaluate {

inline std::string MapName(int map_id) { return "map_000" + std::to_string(map_id); }

// marks.csv, and the member of summary.json; nothing where there are no marks.
inline std::string WriteMarks(const TextFolder& folder, const std::string& name, const RunMarks& marks) {
  if (marks.set.empty() && marks.refused.empty()) return {};
  using nlohmann::json;
  json set = json::array(), refused = json::array();
  for (const RunMark& mark : marks.set) {
    set.push_back({{"label", mark.label},
                   {"map_id", mark.map_id},
                   {"session", mark.session},
                   {"frame_idx", mark.frame_idx},
                   {"of_this_run", mark.is_of_this_run}});
    if (mark.position) set.back()["position"] = {mark.position->x(), mark.position->y(), mark.position->z()};
  }
  for (const RunRefusedMark& mark : marks.refused) {
    refused.push_back({{"label", mark.label}, {"frame_idx", mark.frame_idx}, {"reason", mark.reason}});
  }
  std::string table = "frame_idx,mark,u_px,v_px,state,distance_in_depths\n";
  for (const RunMarkSighting& sighting : marks.sightings) {
    table += std::to_string(sighting.frame_idx) + "," + marks.set[sighting.mark].label + ",1,2," + sighting.state + ",";
    AppendNumber(sighting.distance_in_depths, &table);
    table += "\n";
  }
  folder.Write(name + "/marks.csv", table);
  return "\"marks\": " + json{{"set", set}, {"refused", refused}}.dump() + ", ";
}

inline void WriteRunFolder(const TextFolder& folder, const std::string& name, const RunOutput& run) {
  std::string frames =
      "frame_idx,timestamp_ns,state,reason,live_map_id,map_id,keyframe_id,num_matches,num_inliers,frame_ms\n";
  std::map<int, std::vector<StampedPose>> trajectories;
  for (const RunFrame& f : run.frames) {
    const char* state = f.is_dropped ? "dropped" : f.live_map_id >= 0 ? "tracking" : "lost";
    frames += std::to_string(f.frame_idx) + "," + std::to_string(f.timestamp_ns) + "," + state + "," +
              (f.is_damaged ? "damaged_frame" : "tracked") + "," + std::to_string(f.live_map_id) + "," +
              std::to_string(f.map_id) + "," + std::to_string(f.keyframe_id) + ",0," + std::to_string(f.num_inliers) +
              ",";
    AppendNumber(f.frame_ms, &frames);
    frames += "\n";
    if (f.map_id >= 0) trajectories[f.map_id].push_back({f.timestamp_ns, f.world_from_cam.Inverse()});
  }
  folder.Write(name + "/frames.csv", frames);

  std::string maps =
      "map_id,status,merged_into,num_keyframes,num_points,num_frames,first_timestamp_ns,last_timestamp_ns\n";
  for (const RunMap& map : run.maps) {
    maps += std::to_string(map.map_id) + "," + map.status + ",-1," + std::to_string(map.num_keyframes) + "," +
            std::to_string(map.num_points) + ",0,0,0\n";
  }
  folder.Write(name + "/maps.csv", maps);

  std::string events = "frame_idx,timestamp_ns,event,map_id,other_map_id,details\n";
  for (const RunEventRow& event : run.events) {
    events += std::to_string(event.frame_idx) + ",0," + event.event + "," + std::to_string(event.map_id) + "," +
              std::to_string(event.other_map_id) + ",accepted keyframe=9 other_keyframe=3 votes=12\n";
  }
  folder.Write(name + "/events.csv", events);

  for (const auto& [map_id, poses] : trajectories) {
    StringSink sink;
    EXPECT_TRUE(WriteTum(sink, poses).ok());
    folder.Write(name + "/trajectory/" + MapName(map_id) + ".tum", sink.bytes());
  }
  folder.Write(name + "/summary.json",
               "{" + WriteMarks(folder, name, run.marks) +
                   R"("mode": "sequential", "device": "cpu", "seed": 3, "frames": )" +
                   std::to_string(run.frames.size()) +
                   R"(, "frame_ms": {"p50": 21.5, "p99": 33.0, "p999": 40.0, "max": 41.0}, "dropped": 0,
                   "peak_rss_mb": 512.5, "realtime_ratio": 1.25, "mapping": {"mean_ms": {"bundle": 80.5, "fuse": 4}}})");
}

}  // namespace haustra::evaluate
