// What page/run.js shows of a finished run, as JSON:
//   name, mode, device, period_ms
//   maps    id, status, keyframes, points (float32 x y z), rgb (uint8), surface (name of a resource, or null),
//           wall (its entry in surface.json, with map and picture (name of a resource, or null); or null)
//   frames  columns: index (int32), time_s, map (int32, at the end; -1: none), live_map (int32), state (uint8),
//           inliers (int32), latency_ms (float32, NaN: not known), position (float32 x y z), orientation (x y z w)
//   states  words that the column of states counts
//   events  frame, event, map, other_map, details; no more than num_events, the first
//   marks   label, map, position (in that map at the end, or null), frame (that it was set in, -1: in an earlier run),
//           and a row a frame: state (uint8, 255: its map was not tracked), distance (float32, depths of the scene)
//   mark_states  words that the column of states of marks counts
// A column is base64 of little-endian numbers. Times count from the first frame, poses are map_from_cam, lengths are
// map units. reentrant, deterministic.
#pragma once

#include <map>
#include <string>

#include "tools/evaluate/run_output.h"
#include "tools/report/map_model.h"

namespace haustra::view {

// What is shown of the wall of a map.
struct ShownWall {
  std::string mesh;      // name of a resource
  std::string coverage;  // JSON, the value of "wall"; empty: null
};

// models: of the maps that were exported, by map id; walls: where they have any, by map id.
std::string MakeRunData(const evaluate::RunOutput& run, const std::map<int, report::MapModel>& models,
                        const std::map<int, ShownWall>& walls);

}  // namespace haustra::view
