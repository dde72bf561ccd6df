// The figures of a run, in the terms of the evaluation: what summary.json and the console show.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "tools/run/final_poses.h"
#include "tools/run/mark_log.h"
#include "tools/run/periodic_motion.h"
#include "tools/run/run_record.h"

namespace haustra {

struct LatencyFigures {
  double p50 = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;  // ms
};

// How full a pool was. `refused`: what found no room after eviction had done what it could.
struct PoolFigures {
  std::string name;
  std::uint64_t capacity = 0;
  std::uint64_t used = 0;
  std::uint64_t peak = 0;
  std::uint64_t refused = 0;
};

// What the kernel and the heap did to the tracking thread, over all frames.
struct TrackingThreadFigures {
  ThreadUse first_frame;                 // which pays for what is set up on first use
  ThreadUse later;                       // all others
  std::uint64_t frames_with_faults = 0;  // of the others
};

// A mark that exists at the end, and in how many frames it was in which state.
struct MarkFigures {
  MarkId id = 0;
  std::string label;
  std::uint32_t session = 0;      // that set it
  std::uint32_t frame_index = 0;  // likewise, of that session
  bool is_of_this_run = false;
  MapId map_id = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in that map
  std::array<std::size_t, 4> num_frames{};             // by MarkState
};

struct RefusedMark {
  std::string label;
  std::uint32_t frame_index = 0;
  std::string reason;
};

// Of a run with depth.enabled.
struct DepthFigures {
  DepthCounters counters;
  std::uint64_t num_pictures_refused = 0;
  std::size_t num_keyframes = 0;  // that have a depth at the end
};

// Of the surface that a run with depth.enabled ends with.
struct SurfaceFigures {
  std::string why_not;             // there is none; empty: there is one
  std::string maps_json;           // how much of the wall each map has seen, as in surface.json
  std::vector<std::string> lines;  // likewise for people, with their line breaks; of each map one or two
};

// Between scope and wall, in the path through one map.
struct MapMotion {
  MapId map_id = 0;
  PeriodicMotion motion;
};

// How far away the wall is in the keyframes of a map, in its units: percentiles over the keyframes of their median
// depth.
struct SceneDepths {
  MapId map_id = 0;
  std::size_t num_keyframes = 0;
  double p5 = 0.0, p50 = 0.0, p95 = 0.0;  // > 0
};

struct RunSummary {
  std::string mode;
  std::string device;
  std::string calibration_json;  // how it was estimated from the clip; empty: it was given
  std::uint64_t seed = 0;
  std::uint32_t first_frame = 0, every_nth = 1;  // the part of the sequence, as SequenceOptions have it
  std::size_t frames = 0;                        // that were answered
  std::size_t sequence_frames = 0;               // those that an aborted run did not come to among them
  std::size_t tracked = 0;                       // answered at the time with a pose, whatever became of its map
  // Answered at the time with a pose in a map that exists at the end, be it in one that it was merged into.
  std::size_t live_localised = 0;
  double live_coverage = 0.0;  // percent of the sequence
  std::size_t localised = 0;   // have a pose at the end
  double coverage = 0.0;       // percent of the sequence
  std::size_t maps = 0;        // that exist at the end with at least one localised frame
  std::size_t maps_created = 0;
  std::size_t merges = 0;
  std::size_t loops = 0;
  std::size_t relocalisations = 0;
  std::size_t losses = 0;
  std::size_t largest_map_frames = 0;
  std::size_t keyframes = 0;   // of all maps at the end, loaded ones included
  std::size_t map_points = 0;  // likewise
  std::size_t maps_loaded = 0;
  std::size_t keyframes_loaded = 0;  // of earlier runs, that are still there
  LatencyFigures frame_ms;
  std::size_t dropped = 0;
  std::size_t damaged = 0;
  std::size_t interlaced = 0;  // pictures that were shown by one of their two fields
  double peak_rss_mb = 0.0;
  double plan_host_mb = 0.0;  // of the engine; the vision device's is in `haustra plan`
  std::vector<PoolFigures> pools;
  EvictionCounters evictions;
  TrackingThreadFigures tracking_thread;
  bool is_heap_watched = false;
  double video_s = 0.0;
  double wall_s = 0.0;
  double realtime_ratio = 0.0;  // wall time over video time
  MapperCounters mapping;
  std::vector<MarkFigures> marks;  // by id
  std::vector<RefusedMark> refused_marks;
  std::vector<MapMotion> motions;         // by map id
  std::vector<SceneDepths> scene_depths;  // likewise
  std::optional<DepthFigures> depth;
  std::optional<SurfaceFigures> surface;  // nothing while none was asked for
  // Real-time mode only.
  std::optional<RealTimeReport> realtime;
  double rate = 1.0;     // pace that was asked for, relative to the camera: frames came this much faster
  std::size_t late = 0;  // answered after their deadline
  std::array<std::size_t, kNumRungs> on_rung{};
  double heap_growth_mb = 0.0;  // beyond what was set aside at the start
};

// `sequence_frames`: how many the sequence has; 0: not known, those that were answered.
RunSummary Summarise(const RunRecord& record, const std::vector<FinalPose>& poses, Engine& engine,
                     const SessionSummary& session, std::size_t sequence_frames);

// The marks of the run, into its summary.
void SummariseMarks(const MarkLog& log, const Engine& engine, RunSummary* summary);

std::string ToJson(const RunSummary& summary);
// A few lines for a person.
std::string ToText(const RunSummary& summary);

}  // namespace haustra
