#include "tools/evaluate/evaluate_run.h"

#include <algorithm>
#include <cmath>

#include "tools/evaluate/path_segments.h"
#include "tools/evaluate/recall.h"

namespace haustra::evaluate {
namespace {

double Percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::vector<EvaluatedFrame> JoinWithReference(const RunOutput& run, const Reference& reference) {
  const std::vector<std::optional<SE3>> truth = Associate(run.frames, reference.poses);
  const std::vector<bool> is_clear = FindClearFrames(run.frames, run.figures.part, reference);
  std::vector<EvaluatedFrame> frames;
  frames.reserve(run.frames.size());
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    const RunFrame& frame = run.frames[i];
    frames.push_back({frame.frame_idx, frame.live_map_id, frame.map_id, frame.keyframe_id, is_clear[i], truth[i],
                      frame.world_from_cam, 0.0, frame.reason == "recovered"});
  }
  return frames;
}

// Maps that exist at the end, and those that have become part of one.
std::set<int> FindLastingMaps(const RunOutput& run) {
  MapGroups groups;
  for (const RunMap& map : run.maps) {
    if (map.merged_into >= 0) groups.Merge(map.merged_into, map.map_id);
  }
  // maps.csv does not keep a merged map for ever.
  for (const RunEventRow& event : run.events) {
    if (event.event == "merged") groups.Merge(event.map_id, event.other_map_id);
  }
  std::set<int> lasting;
  for (const RunMap& map : run.maps) {
    if (map.status == "active" || map.status == "stored") lasting.merge(std::set<int>(groups.Of(map.map_id)));
  }
  return lasting;
}

// Between frames, in time; at most 63 years, so that it can be added to any time stamp.
std::int64_t DistanceNs(std::int64_t num_frames, std::int64_t period_ns) {
  constexpr double kLongestNs = 2e18;
  const double distance_ns = static_cast<double>(num_frames) * static_cast<double>(period_ns);
  return static_cast<std::int64_t>(std::clamp(distance_ns, -kLongestNs, kLongestNs));
}

struct UnansweredFrames {
  std::size_t count = 0;
  std::size_t num_clear = 0;  // by the times that they must have had
};

// Frames of the sequence that the run's output does not have. They are counted, not kept: a damaged video may claim any
// number of them.
UnansweredFrames CountUnansweredFrames(const RunOutput& run, const Reference& reference) {
  if (run.frames.empty()) return {};
  const RunFrame& last = run.frames.back();
  const std::int64_t num_frames = std::max(last.frame_idx + 1, run.figures.sequence_frames.value_or(0));
  UnansweredFrames unanswered;
  unanswered.count = static_cast<std::size_t>(num_frames) - run.frames.size();
  if (!reference.events) return unanswered;
  const std::int64_t period_ns = FramePeriodNs(run.frames);
  const bool are_stamps_known = reference.frame_stamps_ns.size() == static_cast<std::size_t>(num_frames);
  auto next = run.frames.begin();
  for (std::int64_t i = 0; i < num_frames; ++i) {
    if (next != run.frames.end() && next->frame_idx == i) {
      ++next;
      continue;
    }
    const RunFrame& neighbour = next == run.frames.end() ? last : *next;
    RunFrame frame;
    frame.frame_idx = i;
    frame.timestamp_ns = are_stamps_known ? reference.frame_stamps_ns[static_cast<std::size_t>(i)]
                                          : neighbour.timestamp_ns + DistanceNs(i - neighbour.frame_idx, period_ns);
    unanswered.num_clear += IsClear(frame, run.figures.part, reference) ? 1 : 0;
  }
  return unanswered;
}

void CountFrames(const RunOutput& run, const Reference& reference, const std::vector<EvaluatedFrame>& frames,
                 Evaluation* evaluation) {
  const std::set<int> lasting_maps = FindLastingMaps(run);
  std::size_t num_clear = 0, num_clear_localised = 0, num_clear_live = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const bool is_live = lasting_maps.contains(frames[i].live_map_id);
    evaluation->live_localised += is_live ? 1 : 0;
    evaluation->localised += frames[i].is_localised() ? 1 : 0;
    evaluation->frames_without_groundtruth += frames[i].truth ? 0 : 1;
    evaluation->dropped += run.frames[i].is_dropped ? 1 : 0;
    evaluation->damaged += run.frames[i].is_damaged ? 1 : 0;
    if (!frames[i].is_clear) continue;
    ++num_clear;
    num_clear_localised += frames[i].is_localised() ? 1 : 0;
    num_clear_live += is_live ? 1 : 0;
  }
  const UnansweredFrames unanswered = CountUnansweredFrames(run, reference);
  evaluation->unanswered_frames = unanswered.count;
  evaluation->frames = frames.size() + unanswered.count;
  evaluation->interlaced = run.figures.interlaced.value_or(0);
  evaluation->live_coverage = Percent(evaluation->live_localised, evaluation->frames);
  evaluation->coverage = Percent(evaluation->localised, evaluation->frames);
  if (reference.events) {
    num_clear += unanswered.num_clear;
    evaluation->visible_frames = num_clear;
    evaluation->live_visible_localised = num_clear_live;
    evaluation->live_visible_coverage = Percent(num_clear_live, num_clear);
    evaluation->visible_localised = num_clear_localised;
    evaluation->visible_coverage = Percent(num_clear_localised, num_clear);
  }
}

// Trajectory error and the paper's figures of one map.
MapEvaluation EvaluateMap(int map_id, const RunOutput& run, const std::vector<EvaluatedFrame>& frames,
                          std::optional<Alignment>* alignment) {
  MapEvaluation map;
  map.map_id = map_id;
  std::vector<PosePair> pairs;
  double num_observations = 0.0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames[i].map_id != map_id) continue;
    ++map.frames;
    num_observations += run.frames[i].num_inliers;
    if (frames[i].truth) pairs.push_back(frames[i].pair());
  }
  map.true_frames = pairs.size();
  *alignment = Align(pairs);
  if (*alignment) {
    map.ate_frames = pairs.size();
    map.rms_ate = (*alignment)->rms();
    map.max_error = (*alignment)->max_error;
    map.truth_from_map = (*alignment)->truth_from_map;
    map.scale = map.truth_from_map->scale;
    map.scale_drift = FindScaleDrift(pairs);
  }
  const auto row = std::find_if(run.maps.begin(), run.maps.end(), [&](const RunMap& m) { return m.map_id == map_id; });
  if (row != run.maps.end()) {
    map.keyframes = row->num_keyframes;
    map.map_points = row->num_points;
  }
  map.life_time_s = static_cast<double>(map.frames) * static_cast<double>(FramePeriodNs(run.frames)) * 1e-9;
  if (map.life_time_s > 0.0) map.keyframes_per_s = map.keyframes / map.life_time_s;
  map.observations_per_frame = num_observations / static_cast<double>(map.frames);
  if (map.map_points > 0) map.observations_per_point = num_observations / map.map_points;
  return map;
}

void SetDepth(double depth, MapEvaluation* map) {
  map->scene_depth = depth;
  if (map->rms_ate) map->rms_ate_percent_of_depth = 100.0 * *map->rms_ate / depth;
}

// Distance of the scene from each frame, in ground-truth units: of the keyframe that the frame belongs to, else typical
// for its map, else typical for the run. Maps get the median over their frames.
std::optional<double> AssignDepths(const RunOutput& run, double given_depth, std::vector<MapEvaluation>* maps,
                                   std::vector<EvaluatedFrame>* frames) {
  if (given_depth > 0.0) {
    for (EvaluatedFrame& frame : *frames) frame.depth = given_depth;
    for (MapEvaluation& map : *maps) SetDepth(given_depth, &map);
    return given_depth;
  }
  std::vector<double> depths;
  for (MapEvaluation& map : *maps) {
    const auto geometry = run.geometry.find(map.map_id);
    if (!map.scale || geometry == run.geometry.end() || geometry->second.depth_mu <= 0.0) continue;
    std::vector<double> depths_in_map;
    for (std::size_t i = 0; i < frames->size(); ++i) {
      EvaluatedFrame& frame = (*frames)[i];
      if (frame.map_id != map.map_id) continue;
      const auto keyframe = geometry->second.keyframe_depth_mu.find(run.frames[i].keyframe_id);
      const bool is_known = keyframe != geometry->second.keyframe_depth_mu.end();
      frame.depth = *map.scale * (is_known ? keyframe->second : geometry->second.depth_mu);
      depths_in_map.push_back(frame.depth);
    }
    depths.insert(depths.end(), depths_in_map.begin(), depths_in_map.end());
    SetDepth(Median(std::move(depths_in_map)), &map);
  }
  if (depths.empty()) return std::nullopt;
  const double typical = Median(std::move(depths));
  for (EvaluatedFrame& frame : *frames) {
    if (frame.depth <= 0.0) frame.depth = typical;
  }
  return typical;
}

void CountEvents(const std::vector<RunEventRow>& events, Evaluation* evaluation) {
  for (const RunEventRow& event : events) {
    evaluation->maps_created += event.event == "map_created" ? 1 : 0;
    evaluation->losses += event.event == "lost" ? 1 : 0;
  }
}

void CountJoins(Evaluation* evaluation) {
  for (const JoinEvaluation& join : evaluation->joins) {
    JoinCount& count = join.kind == JoinKind::kMerge            ? evaluation->merges
                       : join.kind == JoinKind::kLoop           ? evaluation->loops
                       : join.kind == JoinKind::kRelocalisation ? evaluation->relocalisations
                                                                : evaluation->recoveries;
    ++count.made;
    if (join.verdict == Verdict::kUnjudged) continue;
    ++count.judged;
    if (join.verdict == Verdict::kFalse) {
      ++count.wrong;
      ++evaluation->false_merges;
    }
  }
}

// The camera that the maps were made with.
std::optional<CameraModel> FindCamera(const RunOutput& run) {
  for (const auto& [map_id, geometry] : run.geometry) {
    if (Result<CameraModel> camera = CameraModel::Create(geometry.camera); camera.ok()) return *camera;
  }
  return std::nullopt;
}

void FindRecall(const RunOutput& run, const std::vector<EvaluatedFrame>& frames, bool positions_only,
                Evaluation* evaluation) {
  const std::optional<CameraModel> camera = FindCamera(run);
  if (positions_only || !camera || !evaluation->scene_depth) {
    const char* why = positions_only          ? "it needs true orientations"
                      : evaluation->maps == 0 ? "no frame is localised in a map"
                                              : "it needs the maps' export (maps/) for camera and depth";
    evaluation->warnings.push_back(std::string("recall is not known: ") + why);
    return;
  }
  const SharedView shared_view(*camera);
  evaluation->merge_recall = FindMergeRecall(frames, shared_view);
  evaluation->relocalisation_recall = FindRelocalisationRecall(frames, run.events, shared_view);
}

// Of frames as they came, at the pace of the run. 0: unknown.
double PeriodMs(const RunOutput& run) {
  return static_cast<double>(FramePeriodNs(run.frames)) * 1e-6 / run.figures.rate.value_or(1.0);
}

void FindTimes(const RunOutput& run, double given_deadline_ms, Evaluation* evaluation) {
  const double period_ms = PeriodMs(run);
  const double deadline_ms = given_deadline_ms > 0.0 ? given_deadline_ms : period_ms;
  if (deadline_ms > 0.0) evaluation->deadline_ms = deadline_ms;
  // A sequential run has no latency: its frames.csv holds zeros, and summary.json the processing times.
  std::vector<double> latencies_ms;
  std::size_t num_late = 0;
  for (const RunFrame& frame : run.frames) {
    if (frame.is_dropped || frame.is_damaged || frame.frame_ms <= 0.0) continue;
    latencies_ms.push_back(frame.frame_ms);
    num_late += frame.frame_ms > deadline_ms ? 1 : 0;
  }
  const RunFigures& figures = run.figures;
  evaluation->frame_ms = latencies_ms.empty() ? figures.frame_ms : FindPercentiles(latencies_ms);
  if (!latencies_ms.empty() && deadline_ms > 0.0) {
    evaluation->deadline_misses = num_late;
  } else if (figures.deadline_misses) {
    evaluation->deadline_misses = static_cast<std::size_t>(*figures.deadline_misses);
  }
  evaluation->peak_rss_mb = figures.peak_rss_mb;
  evaluation->realtime_ratio = figures.realtime_ratio;
  evaluation->mean_stage_ms = figures.mean_stage_ms;
}

// Whether joining maps costs tracking anything: frames tracked meanwhile against the others that were tracked (lost
// ones do other work). The mapper notes a duration with the newest frame that was tracked when it was over.
void FindTimesBesideJoining(const RunOutput& run, Evaluation* evaluation) {
  const double period_ms = PeriodMs(run);
  if (period_ms <= 0.0) return;
  std::vector<std::pair<double, double>> spans;  // first and last frame
  for (const StageTime& time : run.times) {
    if (time.stage != "merging/total") continue;
    const auto frame_idx = static_cast<double>(time.frame_idx);
    spans.emplace_back(frame_idx - std::ceil(time.ms / period_ms), frame_idx + 1);
  }
  std::vector<double> joining_ms, other_ms;
  for (const RunFrame& frame : run.frames) {
    if (frame.live_map_id < 0 || frame.is_dropped || frame.is_damaged || frame.frame_ms <= 0.0) continue;
    const bool is_joining = std::any_of(spans.begin(), spans.end(), [&](const auto& span) {
      const auto frame_idx = static_cast<double>(frame.frame_idx);
      return span.first <= frame_idx && frame_idx <= span.second;
    });
    (is_joining ? joining_ms : other_ms).push_back(frame.frame_ms);
  }
  if (joining_ms.empty() || other_ms.empty()) return;
  evaluation->joining_frames = joining_ms.size();
  evaluation->joining_frame_ms = FindPercentiles(std::move(joining_ms));
  evaluation->other_frame_ms = FindPercentiles(std::move(other_ms));
}

void FindStageTimes(const std::vector<StageTime>& times, Evaluation* evaluation) {
  std::vector<std::string> order;
  std::map<std::string, std::vector<double>> durations_ms;
  for (const StageTime& time : times) {
    std::vector<double>& durations = durations_ms[time.stage];
    if (durations.empty()) order.push_back(time.stage);
    durations.push_back(time.ms);
  }
  for (const std::string& stage : order) {
    const std::vector<double>& durations = durations_ms[stage];
    const Percentiles percentiles = *FindPercentiles(durations);
    const Spread spread = FindSpread(durations);
    evaluation->stages.push_back(
        {stage, spread.count, percentiles.p50, percentiles.p99, percentiles.max, spread.mean, spread.deviation});
  }
}

// A merge or a loop is the next one that the mapper timed; finding a pose took as long as tracking did in its frame.
void FindJoinTimes(const std::vector<StageTime>& times, std::vector<JoinEvaluation>* joins) {
  std::vector<double> joining_ms;
  std::map<std::int64_t, double> tracking_ms;
  for (const StageTime& time : times) {
    if (time.stage == "merging/total") joining_ms.push_back(time.ms);
    if (time.stage == "tracking/total") tracking_ms[time.frame_idx] = time.ms;
  }
  const auto is_by_mapper = [](const JoinEvaluation& join) {
    return join.kind == JoinKind::kMerge || join.kind == JoinKind::kLoop;
  };
  const auto num_joined = std::count_if(joins->begin(), joins->end(), is_by_mapper);
  const bool is_complete = joining_ms.size() == static_cast<std::size_t>(num_joined);
  std::size_t next = 0;
  for (JoinEvaluation& join : *joins) {
    if (!is_by_mapper(join)) {
      if (const auto found = tracking_ms.find(join.frame_idx); found != tracking_ms.end()) {
        join.duration_ms = found->second;
      }
    } else if (is_complete) {
      join.duration_ms = joining_ms[next++];
    }
  }
}

MapTable TableOf(const MapEvaluation& map) {
  return {static_cast<double>(map.keyframes), static_cast<double>(map.map_points), map.keyframes_per_s, map.life_time_s,
          map.observations_per_frame,         map.observations_per_point};
}

void FillMapTables(Evaluation* evaluation) {
  if (evaluation->per_map.empty()) return;
  MapTable mean;
  const MapEvaluation* largest = &evaluation->per_map.front();
  for (const MapEvaluation& map : evaluation->per_map) {
    const MapTable table = TableOf(map);
    const double weight = 1.0 / static_cast<double>(evaluation->per_map.size());
    mean.keyframes += weight * table.keyframes;
    mean.map_points += weight * table.map_points;
    mean.keyframes_per_s += weight * table.keyframes_per_s;
    mean.life_time_s += weight * table.life_time_s;
    mean.observations_per_frame += weight * table.observations_per_frame;
    mean.observations_per_point += weight * table.observations_per_point;
    if (map.frames > largest->frames) largest = &map;
    evaluation->keyframes += static_cast<std::size_t>(map.keyframes);
    evaluation->map_points += static_cast<std::size_t>(map.map_points);
  }
  evaluation->mean_map = mean;
  evaluation->largest_map = TableOf(*largest);
  evaluation->largest_map_frames = largest->frames;
  evaluation->largest_map_rms_ate = largest->rms_ate;
  evaluation->largest_map_rms_ate_percent_of_depth = largest->rms_ate_percent_of_depth;
}

// All maps, and their errors pooled.
void EvaluateMaps(const RunOutput& run, const std::vector<EvaluatedFrame>& frames, Evaluation* evaluation) {
  std::set<int> map_ids;
  for (const EvaluatedFrame& frame : frames) {
    if (frame.is_localised()) map_ids.insert(frame.map_id);
  }
  double squared_error = 0.0, max_error = 0.0;
  for (const int map_id : map_ids) {
    std::optional<Alignment> alignment;
    evaluation->per_map.push_back(EvaluateMap(map_id, run, frames, &alignment));
    if (!alignment) {
      ++evaluation->left_out_maps;
      continue;
    }
    squared_error += alignment->squared_error;
    max_error = std::max(max_error, alignment->max_error);
    evaluation->ate_frames += alignment->count;
  }
  evaluation->maps = map_ids.size();
  evaluation->left_out_frames = evaluation->localised - evaluation->ate_frames;
  if (evaluation->ate_frames > 0) {
    evaluation->rms_ate = std::sqrt(squared_error / static_cast<double>(evaluation->ate_frames));
    evaluation->max_error = max_error;
  }
}

}  // namespace

Evaluation EvaluateRun(const RunOutput& run, const Reference& reference, const EvaluateOptions& options) {
  Evaluation evaluation;
  evaluation.name = run.folder;
  evaluation.mode = run.figures.mode;
  evaluation.device = run.figures.device;
  evaluation.seed = run.figures.seed;
  evaluation.unit = reference.unit;
  evaluation.warnings = run.warnings;

  std::vector<EvaluatedFrame> frames = JoinWithReference(run, reference);
  CountFrames(run, reference, frames, &evaluation);
  // No ground truth at all was the caller's choice.
  if (!reference.poses.empty() && evaluation.frames_without_groundtruth == frames.size()) {
    evaluation.warnings.push_back("no frame of the run has a true pose: do the time stamps belong together?");
  }
  EvaluateMaps(run, frames, &evaluation);
  evaluation.scene_depth = AssignDepths(run, options.scene_depth, &evaluation.per_map, &frames);
  FillMapTables(&evaluation);
  if (options.segment > 0.0) evaluation.segments = EvaluateSegments(frames, evaluation.per_map, options.segment);
  CountEvents(run.events, &evaluation);
  evaluation.joins = JudgeJoins(frames, run.events, options.joins);
  CountJoins(&evaluation);
  if (!reference.poses.empty()) FindRecall(run, frames, options.joins.positions_only, &evaluation);
  FindTimes(run, options.deadline_ms, &evaluation);
  FindTimesBesideJoining(run, &evaluation);
  FindStageTimes(run.times, &evaluation);
  FindJoinTimes(run.times, &evaluation.joins);
  return evaluation;
}

}  // namespace haustra::evaluate
