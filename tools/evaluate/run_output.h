// The output folder of a run, read back: frames.csv, maps.csv, events.csv, times.csv, the final trajectory and the
// exported geometry of each map, the times in summary.json, and the marks.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/sequence_options.h"
#include "engine/geometry/se3.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "tools/evaluate/run_marks.h"

namespace haustra::evaluate {

struct RunFrame {
  std::int64_t frame_idx = 0;
  std::int64_t timestamp_ns = 0;
  std::string state;   // as it was answered: initialising, tracking, lost, dropped
  std::string reason;  // of the state
  bool is_dropped = false;
  bool is_damaged = false;
  int live_map_id = -1;  // map of the pose that was answered, -1: none
  int map_id = -1;       // map that the frame belongs to at the end, -1: not localised
  std::int64_t keyframe_id = -1;
  int num_inliers = 0;    // map points observed
  double frame_ms = 0.0;  // 0 in a sequential run
  SE3 world_from_cam;     // final pose in the map's frame, map units; when map_id >= 0
};

struct RunMap {
  int map_id = -1;
  std::string status;  // active, stored, merged, dropped
  int num_keyframes = 0;
  int num_points = 0;
  int merged_into = -1;  // another map, -1: none
};

struct RunEventRow {
  std::int64_t frame_idx = 0;
  std::string event;
  int map_id = -1;
  int other_map_id = -1;
  std::optional<std::int64_t> other_keyframe_id;  // that was met again: "other_keyframe=N" among the details
  std::string details;                            // words and name=number, between blanks
};

// The number after "name=" among the details of an event.
std::optional<std::int64_t> DetailOf(const RunEventRow& event, std::string_view name);

// One duration that was measured.
struct StageTime {
  std::int64_t frame_idx = 0;
  std::string stage;  // part of the system, '/', what it did: "mapping/bundle"; "total" is all of the part
  double ms = 0.0;
};

// What a map's export says about the camera and the distance of the scene.
struct MapGeometry {
  CameraCalibration camera;
  std::map<std::int64_t, double> keyframe_depth_mu;  // by keyframe id: median distance of the points that it sees
  double depth_mu = 0.0;                             // median over the keyframes, 0: no points
};

struct Percentiles {
  double p50 = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;
};

// A part of a run in which scope and wall move to and fro, as seen by one map.
struct PeriodicStretchRow {
  double from_s = 0.0, to_s = 0.0;  // from the first frame
  double period_s = 0.0;
  double amplitude_percent = 0.0;  // of the scene depth
  double chance = 0.0;
};

// What summary.json says of the motion between scope and wall in one map.
struct MapMotionRow {
  int map_id = -1;
  double longest_period_s = 0.0;  // that was looked for; 0: the path is too short for any
  std::vector<PeriodicStretchRow> found;
};

// summary.json, where it says something that the tables do not.
struct RunFigures {
  std::string mode;
  std::string device;
  std::string calibration_note;             // what a reader must know of the calibration; empty: nothing
  std::vector<std::string> scale_warnings;  // one for each map that has lost its scale
  std::optional<std::int64_t> seed;
  SequenceOptions part;  // of the sequence, as far as frames are counted: first_frame and every_nth
  std::optional<std::int64_t> frames;
  std::optional<std::int64_t> sequence_frames;  // that an aborted run would have come to, too
  std::optional<Percentiles> frame_ms;
  std::optional<std::int64_t> dropped;
  std::optional<std::int64_t> interlaced;  // pictures that were shown by one of their two fields
  std::optional<std::int64_t> deadline_misses;
  std::optional<double> peak_rss_mb;
  std::optional<double> realtime_ratio;
  std::optional<double> rate;                   // > 0; of a real-time run: its pace relative to the camera
  std::map<std::string, double> mean_stage_ms;  // of the mapper, a keyframe
  std::vector<MapMotionRow> motions;            // none: the run did not look for them
};

struct RunOutput {
  std::string folder;
  std::vector<RunFrame> frames;  // by frame_idx, strictly increasing
  std::vector<RunMap> maps;
  std::vector<RunEventRow> events;      // by frame_idx
  std::map<int, MapGeometry> geometry;  // by map id; maps without an export are missing
  std::vector<StageTime> times;         // in the file's order; none when there is no times.csv
  RunFigures figures;
  RunMarks marks;
  std::vector<std::string> warnings;  // what did not fit together, but can be evaluated
};

// kNotFound: no such folder, or one of its tables or trajectories is missing. kInvalidArgument: a file is not what it
// should be, with file and line. A frame that frames.csv calls localised but that has no pose in its map's trajectory
// counts as not localised, with a warning.
Result<RunOutput> ReadRunOutput(const std::string& folder);

}  // namespace haustra::evaluate
