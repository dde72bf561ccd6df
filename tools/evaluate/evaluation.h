// What an evaluation says: plain data, separate from how it is found (evaluate_run.h) and shown (report_*.h,
// run_table.h). The terms are those of the project's evaluation rules; lengths are in the unit of the ground truth.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/geometry/sim3.h"
#include "tools/evaluate/statistics.h"

namespace haustra::evaluate {

// One map that exists at the end.
struct MapEvaluation {
  int map_id = -1;
  std::size_t frames = 0;         // localised in it
  std::size_t true_frames = 0;    // of these with a true pose
  std::size_t ate_frames = 0;     // that the error is of: these, or none
  std::optional<double> rms_ate;  // after its own Sim(3); nothing when left out (too few frames, all on a line)
  std::optional<double> max_error;
  std::optional<double> scene_depth;               // median over its frames, ground-truth units; nothing: not known
  std::optional<double> rms_ate_percent_of_depth;  // of its own depth
  std::optional<double> scale;                     // ground-truth units per map unit
  std::optional<double> scale_drift;               // scale of the last quarter over that of the first; 1: none
  std::optional<Sim3> truth_from_map;              // that gave the error
  // The paper's table.
  int keyframes = 0;
  int map_points = 0;
  double life_time_s = 0.0;  // localised frames times the frame period
  double keyframes_per_s = 0.0;
  double observations_per_frame = 0.0;  // map points observed in a frame (#Obs/F)
  double observations_per_point = 0.0;  // frames that observe a map point (#Obs(F)/MP)
};

// Recovery: a pose found by brute force while tracking.
enum class JoinKind { kMerge, kLoop, kRelocalisation, kRecovery };
enum class Verdict { kTrue, kFalse, kUnjudged };

std::string_view ToString(JoinKind kind);
std::string_view ToString(Verdict verdict);

// One merge, loop, relocalisation or recovery against the ground truth.
struct JoinEvaluation {
  JoinKind kind = JoinKind::kMerge;
  std::int64_t frame_idx = 0;
  int map_id = -1;
  int other_map_id = -1;
  Verdict verdict = Verdict::kUnjudged;
  std::string reason;                              // why it is false or cannot be judged
  std::optional<double> ate_parts;                 // pooled over the two parts, each aligned on its own
  std::optional<double> ate_joined;                // both aligned by one Sim(3)
  std::optional<double> rotation_error_deg;        // of the relative pose of the two parts
  std::optional<double> translation_error_depths;  // the same, as a share of the scene depth
  std::optional<double> ate_joined_depths;         // ate_joined as a share of the scene depth
  std::optional<double> duration_ms;               // merge, loop: of joining; else: of tracking the frame
};

// Joins of one kind in numbers.
struct JoinCount {
  std::size_t made = 0;
  std::size_t judged = 0;
  std::size_t wrong = 0;
  // Right ones over judged ones; nothing when none was judged.
  std::optional<double> precision() const {
    if (judged == 0) return std::nullopt;
    return static_cast<double>(judged - wrong) / static_cast<double>(judged);
  }
};

// How many of the occasions were taken.
struct Recall {
  std::size_t occasions = 0;
  std::size_t taken = 0;
  std::optional<double> value() const {
    if (occasions == 0) return std::nullopt;
    return static_cast<double>(taken) / static_cast<double>(occasions);
  }
};

// Means over maps, or the values of one map.
struct MapTable {
  double keyframes = 0.0;
  double map_points = 0.0;
  double keyframes_per_s = 0.0;
  double life_time_s = 0.0;
  double observations_per_frame = 0.0;
  double observations_per_point = 0.0;
};

// How long one stage took, each time that it ran.
struct StageEvaluation {
  std::string stage;  // "mapping/bundle"
  std::size_t count = 0;
  double p50 = 0.0, p99 = 0.0, max = 0.0;  // ms
  double mean = 0.0, deviation = 0.0;      // ms; deviation of the sample
};

// A stretch of the way that the camera truly went, from `begin` to one segment length farther.
struct SegmentEvaluation {
  double begin = 0.0;             // ground-truth units along the true path, from its first frame
  std::size_t frames = 0;         // with a true pose
  std::size_t localised = 0;      // of these
  std::optional<double> rms_ate;  // after the Sim(3) of each frame's map
  std::optional<double> rms_own;  // each map's part of the stretch after a Sim(3) of its own: how true it is in itself
  std::size_t own_frames = 0;     // that rms_own is of
};

struct Evaluation {
  std::string name;  // folder of the run
  std::string mode;
  std::string device;
  std::optional<std::int64_t> seed;
  std::string unit = "units";
  std::vector<std::string> warnings;

  // Coverage, in percent of all frames of the sequence. Live: a pose was answered at the time of the frame, in a map
  // that exists at the end, be it in one that it was merged into. Otherwise: the frame has a pose at the end.
  std::size_t frames = 0;             // of the sequence
  std::size_t unanswered_frames = 0;  // of these: not in the run's output (it was aborted); they are not localised
  std::size_t live_localised = 0;
  double live_coverage = 0.0;
  std::size_t localised = 0;
  double coverage = 0.0;
  // The same of the frames in which the scene can be seen; nothing: not known.
  std::optional<std::size_t> visible_frames;
  std::optional<std::size_t> live_visible_localised;
  std::optional<double> live_visible_coverage;
  std::optional<std::size_t> visible_localised;
  std::optional<double> visible_coverage;
  std::size_t frames_without_groundtruth = 0;

  std::size_t maps = 0;  // that have a localised frame at the end
  std::size_t maps_created = 0;
  std::size_t losses = 0;
  std::size_t largest_map_frames = 0;
  std::optional<double> largest_map_rms_ate;
  std::optional<double> largest_map_rms_ate_percent_of_depth;
  std::size_t keyframes = 0;
  std::size_t map_points = 0;

  std::optional<double> rms_ate;  // pooled over the frames of all maps that are not left out
  std::optional<double> max_error;
  std::size_t ate_frames = 0;
  std::size_t left_out_maps = 0;      // of the ATE
  std::size_t left_out_frames = 0;    // localised, but not in the ATE
  std::optional<double> scene_depth;  // typical, in ground-truth units

  JoinCount merges, loops, relocalisations, recoveries;
  std::size_t false_merges = 0;                 // of all four kinds: one of them is one too many
  std::optional<Recall> merge_recall;           // pairs of maps that share a view; nothing: cannot be known
  std::optional<Recall> relocalisation_recall;  // losses after which the lost map came into view again

  std::optional<Percentiles> frame_ms;
  // Real-time runs only: of the frames that were tracked while the mapper joined maps or closed a loop, and of all
  // others that were tracked.
  std::optional<Percentiles> joining_frame_ms, other_frame_ms;
  std::size_t joining_frames = 0;
  std::optional<double> deadline_ms;
  std::optional<std::size_t> deadline_misses;  // real-time runs only
  std::size_t dropped = 0;
  std::size_t damaged = 0;
  std::int64_t interlaced = 0;  // pictures that were shown by one of their two fields
  std::optional<double> peak_rss_mb;
  std::optional<double> realtime_ratio;
  std::map<std::string, double> mean_stage_ms;  // of the mapper, a keyframe
  std::vector<StageEvaluation> stages;          // in the order of times.csv; none when the run has no such file

  std::optional<MapTable> mean_map;
  std::optional<MapTable> largest_map;
  std::vector<MapEvaluation> per_map;       // by map id
  std::vector<JoinEvaluation> joins;        // by frame
  std::vector<SegmentEvaluation> segments;  // along the true path; none unless a length was asked for
};

}  // namespace haustra::evaluate
