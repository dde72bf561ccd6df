#include "tools/run/run_summary.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "hal/core/percentile.h"
#include "tools/evaluate/evaluated_frame.h"

namespace haustra {
namespace {

// The wall is some 5 to 100 mm away from an endoscope that sees it: what runs farther apart is no view but the scale.
// Rendered colons have less than 2, short clips of living patients up to 5, one in which tissue is pulled 13.
constexpr double kMaxDepthRange = 20.0;
constexpr std::size_t kMinScaleKeyframes = 20;  // fewer say little about their percentiles

double PeakRssMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1e-6 * 1024.0 * static_cast<double>(usage.ru_maxrss);  // told in units of 1024 bytes
}

void Append(std::string* text, const char* format, ...) __attribute__((format(printf, 2, 3)));
void Append(std::string* text, const char* format, ...) {
  char line[256];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  *text += line;
}

double MsPerKeyframe(Duration total, const MapperCounters& counters) {
  return counters.num_keyframes == 0 ? 0.0 : ToMilliseconds(total) / static_cast<double>(counters.num_keyframes);
}

std::vector<PoolFigures> PoolsOf(Engine& engine, const SessionSummary& session) {
  const Atlas& atlas = engine.atlas();
  const MapperCounters& mapper = engine.mapper_counters();
  const auto pool = [](const char* name, const auto& p, std::uint64_t refused) {
    return PoolFigures{name, p.capacity(), p.size(), p.high_water(), refused};
  };
  const auto capacity = atlas.capacity();
  const int num_sets = Engine::PlanFor(engine.config(), engine.camera().calibration()).max_feature_sets;
  std::vector<PoolFigures> pools = {
      pool("keyframes", atlas.keyframes(), mapper.num_keyframes_refused),
      pool("map_points", atlas.points(), atlas.points().num_refused()),
      pool("maps", atlas.maps(), mapper.num_maps_refused),
      {"keyframe_ids", static_cast<std::uint64_t>(capacity.max_keyframe_ids), atlas.num_keyframe_ids(),
       atlas.num_keyframe_ids(), mapper.num_keyframe_ids_refused},
      {"observations_of_a_point", kMaxObservations, 0, 0, atlas.num_refused_observations()},
      {"proposals", engine.max_proposals(), 0, 0, engine.num_proposals_refused()},
      {"map_events", engine.map_events().capacity(), 0, 0, engine.map_events().num_dropped()},
      {"late_poses", engine.late_poses().capacity(), 0, 0, engine.late_poses().num_dropped()},
      {"feature_sets", static_cast<std::uint64_t>(num_sets), 0, 0, engine.num_feature_sets_refused()},
  };
  if (session.max_unread > 0) {
    pools.push_back({"frames_unread", session.max_unread, 0, 0, session.num_frames_unread});
    pools.push_back({"times_unread", session.max_unread, 0, 0, session.num_times_unread});
  }
  return pools;
}

TrackingThreadFigures ThreadFiguresOf(const RunRecord& record) {
  TrackingThreadFigures figures;
  bool is_first = true;
  for (const FrameOutcome& frame : record.frames()) {
    if (frame.is_dropped || frame.is_damaged) continue;
    if (is_first) {
      figures.first_frame = frame.use;
    } else {
      figures.later += frame.use;
      figures.frames_with_faults += frame.use.minor_faults + frame.use.major_faults > 0;
    }
    is_first = false;
  }
  return figures;
}

nlohmann::ordered_json ToJson(const ThreadUse& use, bool is_heap_watched) {
  nlohmann::ordered_json json = {{"minor_faults", use.minor_faults},
                                 {"major_faults", use.major_faults},
                                 {"voluntary_switches", use.voluntary_switches},
                                 {"involuntary_switches", use.involuntary_switches}};
  if (is_heap_watched) json["heap_calls"] = use.trapped_calls;
  return json;
}

// Maps that exist at the end, and those that have become part of one.
std::set<int> FindLastingMaps(const RunRecord& record, const Engine& engine) {
  evaluate::MapGroups groups;
  // The atlas does not keep a merged map for ever.
  for (const RunEvent& event : record.events()) {
    if (event.event != ToString(MapEventKind::kMerged)) continue;
    groups.Merge(static_cast<int>(event.map_id), static_cast<int>(event.other_map_id));
  }
  std::set<int> lasting;
  engine.atlas().maps().ForEach([&](MapHandle, const Map& map) {
    if (map.status != MapStatus::kActive && map.status != MapStatus::kStored) return;
    lasting.merge(std::set<int>(groups.Of(static_cast<int>(map.id))));
  });
  return lasting;
}

double Percent(std::size_t part, std::size_t whole) {
  return whole == 0 ? 0.0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

MemoryPlan PlanOf(const Engine& engine) {
  return Engine::PlanMemory(engine.config(), engine.camera().width_px(), engine.camera().height_px());
}

std::optional<DepthFigures> DepthFiguresOf(const Engine& engine) {
  const DepthKeeper* depths = engine.depths();
  if (depths == nullptr) return std::nullopt;
  return DepthFigures{depths->counters(), engine.num_pictures_refused(), depths->num_keyframes()};
}

}  // namespace

RunSummary Summarise(const RunRecord& record, const std::vector<FinalPose>& poses, Engine& engine,
                     const SessionSummary& session, std::size_t sequence_frames) {
  RunSummary summary;
  summary.frames = record.frames().size();
  summary.sequence_frames = std::max(summary.frames, sequence_frames);
  std::map<MapId, std::size_t> frames_in_map;
  for (const FinalPose& pose : poses) {
    if (!pose.is_localised) continue;
    ++summary.localised;
    ++frames_in_map[pose.pose.map_id];
  }
  for (const auto& [map_id, num_frames] : frames_in_map) {
    summary.largest_map_frames = std::max(summary.largest_map_frames, num_frames);
  }
  summary.maps = frames_in_map.size();
  const std::set<int> lasting_maps = FindLastingMaps(record, engine);
  for (const FrameOutcome& frame : record.frames()) {
    const bool has_pose = frame.result.state == TrackingState::kTracking;
    summary.live_localised += has_pose && lasting_maps.contains(static_cast<int>(frame.result.map_id));
  }
  summary.tracked = record.num_tracked();
  summary.live_coverage = Percent(summary.live_localised, summary.sequence_frames);
  summary.coverage = Percent(summary.localised, summary.sequence_frames);
  for (const RunEvent& event : record.events()) {
    summary.maps_created += event.event == ToString(MapEventKind::kMapCreated);
    summary.merges += event.event == ToString(MapEventKind::kMerged);
    summary.loops += event.event == ToString(MapEventKind::kLoopClosed);
  }
  summary.relocalisations = record.num_relocalisations();
  summary.losses = record.num_losses();
  summary.dropped = record.num_dropped();
  summary.damaged = record.num_damaged();
  summary.interlaced = record.num_one_field();
  summary.keyframes = engine.atlas().keyframes().size();
  summary.map_points = engine.atlas().points().size();
  engine.atlas().maps().ForEach([&](MapHandle, const Map& map) { summary.maps_loaded += map.is_loaded; });
  engine.atlas().keyframes().ForEach([&](KeyframeHandle, const Keyframe& keyframe) {
    summary.keyframes_loaded += keyframe.session != engine.atlas().session();
  });
  std::vector<double> latency;
  for (const FrameOutcome& frame : record.frames()) {
    if (!frame.is_dropped && !frame.is_damaged) latency.push_back(ToMilliseconds(frame.latency));
  }
  std::sort(latency.begin(), latency.end());
  const std::span<const double> sorted(latency);
  summary.frame_ms = {Percentile(sorted, 500), Percentile(sorted, 990), Percentile(sorted, 999),
                      latency.empty() ? 0.0 : latency.back()};
  summary.peak_rss_mb = PeakRssMb();
  summary.plan_host_mb = static_cast<double>(PlanOf(engine).host_bytes()) / 1e6;
  summary.pools = PoolsOf(engine, session);
  summary.evictions = engine.evictions();
  summary.tracking_thread = ThreadFiguresOf(record);
  summary.is_heap_watched = record.thread_watch() != nullptr;
  summary.video_s = ToSeconds(session.video_time);
  summary.wall_s = ToSeconds(session.wall_time);
  if (summary.video_s > 0) summary.realtime_ratio = summary.wall_s / summary.video_s;
  summary.mapping = engine.mapper_counters();
  summary.depth = DepthFiguresOf(engine);
  if (record.realtime() != nullptr) summary.realtime = *record.realtime();
  summary.late = record.num_late();
  summary.on_rung = record.num_on_rung();
  summary.heap_growth_mb = static_cast<double>(session.heap_growth_bytes) / 1e6;
  return summary;
}

void SummariseMarks(const MarkLog& log, const Engine& engine, RunSummary* summary) {
  const Atlas& atlas = engine.atlas();
  std::map<MarkId, MarkFigures> figures;
  atlas.marks().ForEach([&](MarkHandle, const Mark& mark) {
    MarkFigures& of = figures[mark.id];
    of.id = mark.id;
    of.label = mark.label.view();
    of.session = mark.session;
    of.frame_index = mark.frame_index;
    of.is_of_this_run = mark.session == atlas.session();
    const PlacedMark place = atlas.PlaceOf(mark);
    of.map_id = atlas.map(place.map).id;
    of.position = place.position;
  });
  for (const MarkLog::Row& row : log.rows()) {
    const auto at = figures.find(row.sighting.id);
    if (at != figures.end()) ++at->second.num_frames[static_cast<std::size_t>(row.sighting.state)];
  }
  for (const auto& [id, of] : figures) summary->marks.push_back(of);
  for (const MarkLog::Refused& refused : log.refused()) {
    summary->refused_marks.push_back(
        {std::string(refused.request.label.view()), refused.request.frame_index, refused.reason});
  }
}

namespace {

double MeanMs(Duration sum, std::uint64_t count) {
  return count > 0 ? ToMilliseconds(sum) / static_cast<double>(count) : 0.0;
}

nlohmann::ordered_json MarksJson(const RunSummary& s) {
  nlohmann::ordered_json set = nlohmann::ordered_json::array(), refused = nlohmann::ordered_json::array();
  for (const MarkFigures& mark : s.marks) {
    nlohmann::ordered_json frames;
    for (std::size_t i = 0; i < mark.num_frames.size(); ++i) {
      frames[std::string(ToString(static_cast<MarkState>(i)))] = mark.num_frames[i];
    }
    set.push_back({{"label", mark.label},
                   {"map_id", mark.map_id},
                   {"position", {mark.position.x(), mark.position.y(), mark.position.z()}},
                   {"session", mark.session},
                   {"frame_idx", mark.frame_index},
                   {"of_this_run", mark.is_of_this_run},
                   {"frames", frames}});
  }
  for (const RefusedMark& mark : s.refused_marks) {
    refused.push_back({{"label", mark.label}, {"frame_idx", mark.frame_index}, {"reason", mark.reason}});
  }
  return {{"set", set}, {"refused", refused}};
}

nlohmann::ordered_json MotionsJson(const std::vector<MapMotion>& motions) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const MapMotion& of : motions) {
    nlohmann::ordered_json found = nlohmann::ordered_json::array();
    for (const PeriodicStretch& stretch : of.motion.stretches) {
      found.push_back({{"from_s", stretch.from_s},
                       {"to_s", stretch.to_s},
                       {"period_s", stretch.period_s},
                       {"amplitude_percent", 100.0 * stretch.amplitude},
                       {"chance", stretch.chance}});
    }
    json.push_back({{"map_id", of.map_id}, {"longest_period_s", of.motion.longest_period_s}, {"found", found}});
  }
  return json;
}

// The surest that was found, or that there is none; nothing where every path was too short.
std::string MotionText(const std::vector<MapMotion>& motions) {
  const PeriodicStretch* surest = nullptr;
  double longest_period_s = 0.0;
  for (const MapMotion& of : motions) {
    longest_period_s = std::max(longest_period_s, of.motion.longest_period_s);
    for (const PeriodicStretch& stretch : of.motion.stretches) {
      if (surest == nullptr || stretch.chance < surest->chance) surest = &stretch;
    }
  }
  std::string text;
  if (surest != nullptr) {
    Append(&text, "  to and fro    %5.1f s   (scope against wall, by %.1f %% of the depth, seen from %.0f to %.0f s)\n",
           surest->period_s, 100.0 * surest->amplitude, surest->from_s, surest->to_s);
  } else if (longest_period_s > 0.0) {
    Append(&text, "  to and fro     none     (scope against wall, with a period of %.1f to %.1f s)\n", kShortestPeriodS,
           longest_period_s);
  }
  return text;
}

bool HasLostScale(const SceneDepths& of) {
  return of.num_keyframes >= kMinScaleKeyframes && of.p95 >= kMaxDepthRange * of.p5;
}

nlohmann::ordered_json SceneDepthsJson(const std::vector<SceneDepths>& scene_depths) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const SceneDepths& of : scene_depths) {
    json.push_back({{"map_id", of.map_id},
                    {"keyframes", of.num_keyframes},
                    {"p5", of.p5},
                    {"p50", of.p50},
                    {"p95", of.p95},
                    {"scale_lost", HasLostScale(of)}});
  }
  return json;
}

// The maps that have lost their scale; nothing where none has.
std::string ScaleText(const std::vector<SceneDepths>& scene_depths) {
  std::string text;
  for (const SceneDepths& of : scene_depths) {
    if (!HasLostScale(of)) continue;
    Append(&text,
           "  scale          lost     in map %u: what it sees is %.0f times as far away in one part as in another\n",
           static_cast<unsigned>(of.map_id), of.p95 / of.p5);
  }
  return text;
}

}  // namespace

std::string ToJson(const RunSummary& s) {
  nlohmann::ordered_json json;
  json["mode"] = s.mode;
  json["device"] = s.device;
  json["calibration"] = s.calibration_json.empty() ? nlohmann::ordered_json{{"source", "given"}}
                                                   : nlohmann::ordered_json::parse(s.calibration_json);
  json["seed"] = s.seed;
  json["first_frame"] = s.first_frame;
  json["every_nth"] = s.every_nth;
  json["frames"] = s.frames;
  json["sequence_frames"] = s.sequence_frames;
  json["tracked"] = s.tracked;
  json["live_localised"] = s.live_localised;
  json["live_coverage"] = s.live_coverage;
  json["localised"] = s.localised;
  json["coverage"] = s.coverage;
  json["maps"] = s.maps;
  json["maps_created"] = s.maps_created;
  json["merges"] = s.merges;
  json["loops"] = s.loops;
  json["relocalisations"] = s.relocalisations;
  json["losses"] = s.losses;
  json["largest_map_frames"] = s.largest_map_frames;
  json["keyframes"] = s.keyframes;
  json["map_points"] = s.map_points;
  json["maps_loaded"] = s.maps_loaded;
  json["keyframes_loaded"] = s.keyframes_loaded;
  json["frame_ms"] = {
      {"p50", s.frame_ms.p50}, {"p99", s.frame_ms.p99}, {"p999", s.frame_ms.p999}, {"max", s.frame_ms.max}};
  json["dropped"] = s.dropped;
  json["damaged"] = s.damaged;
  json["interlaced"] = s.interlaced;
  json["peak_rss_mb"] = s.peak_rss_mb;
  nlohmann::ordered_json pools;
  for (const PoolFigures& pool : s.pools) {
    nlohmann::ordered_json figures = {{"capacity", pool.capacity}};
    if (pool.peak > 0) figures.update({{"used", pool.used}, {"peak", pool.peak}});
    figures["refused"] = pool.refused;
    pools[pool.name] = figures;
  }
  json["memory"] = {{"engine_plan_mb", s.plan_host_mb},
                    {"pools", pools},
                    {"evicted",
                     {{"keyframes", s.evictions.num_keyframes},
                      {"maps", s.evictions.num_maps},
                      {"map_points", s.evictions.num_points},
                      {"map_entries", s.evictions.num_map_entries}}}};
  json["tracking_thread"] = {{"first_frame", ToJson(s.tracking_thread.first_frame, s.is_heap_watched)},
                             {"later_frames", ToJson(s.tracking_thread.later, s.is_heap_watched)},
                             {"frames_with_faults", s.tracking_thread.frames_with_faults}};
  if (!s.marks.empty() || !s.refused_marks.empty()) json["marks"] = MarksJson(s);
  json["periodic_motion"] = MotionsJson(s.motions);
  json["scene_depth"] = SceneDepthsJson(s.scene_depths);
  if (s.depth) {
    const DepthCounters& depth = s.depth->counters;
    json["depth"] = {{"keyframes_with_depth", s.depth->num_keyframes},
                     {"pictures", depth.num_pictures},
                     {"pictures_refused", s.depth->num_pictures_refused},
                     {"searches", depth.num_searches},
                     {"in_vain", depth.num_in_vain},
                     {"too_little_seen", depth.num_too_little},
                     {"late", depth.num_late},
                     {"ms_per_search", MeanMs(depth.search_time, depth.num_searches)}};
  }
  if (s.surface && s.surface->why_not.empty()) {
    json["surface"] = {{"made", true}, {"maps", nlohmann::ordered_json::parse(s.surface->maps_json)}};
  } else if (s.surface) {
    json["surface"] = {{"made", false}, {"reason", s.surface->why_not}};
  }
  json["video_s"] = s.video_s;
  json["wall_s"] = s.wall_s;
  json["realtime_ratio"] = s.realtime_ratio;
  const MapperCounters& m = s.mapping;
  json["mapping"] = {{"keyframes", m.num_keyframes},
                     {"keyframes_culled", m.num_keyframes_culled},
                     {"keyframes_refused", m.num_keyframes_refused},
                     {"points_created", m.num_points_created},
                     {"points_culled", m.num_points_culled},
                     {"points_fused", m.num_points_fused},
                     {"bundles_stopped", m.num_bundles_stopped},
                     {"foundings_refused", m.num_foundings_refused},
                     {"reliefs_turned", m.num_reliefs_turned},
                     {"snapshots_cut", m.num_snapshots_cut},
                     {"places_skipped", m.num_places_skipped},
                     {"place_points_left_out", m.num_place_points_left_out},
                     {"merges_outdated", m.num_merges_outdated},
                     {"loops_left_open", m.num_loops_left_open},
                     {"mean_ms",
                      {{"insert", MsPerKeyframe(m.insert_time, m)},
                       {"create", MsPerKeyframe(m.create_time, m)},
                       {"fuse", MsPerKeyframe(m.fuse_time, m)},
                       {"bundle", MsPerKeyframe(m.bundle_time, m)},
                       {"cull", MsPerKeyframe(m.cull_time, m)},
                       {"place", MsPerKeyframe(m.place_time, m)},
                       {"merge", MsPerKeyframe(m.merge_time, m)},
                       {"settle", MsPerKeyframe(m.settle_time, m)},
                       {"relocalise", MsPerKeyframe(m.relocalisation_time, m)}}}};
  if (s.realtime) {
    json["rate"] = s.rate;
    json["late"] = s.late;
    for (int i = 0; i < kNumRungs; ++i) {
      json["rungs"][std::string(ToString(static_cast<Rung>(i)))] = s.on_rung[static_cast<std::size_t>(i)];
    }
    const RealTimeReport& report = *s.realtime;
    auto& realtime = json["realtime"];
    realtime = {{"enabled", report.is_enabled},
                {"all_granted", report.is_all_granted()},
                {"kernel", report.kernel_preemption},
                {"memory_locked", report.is_memory_locked},
                {"heap_prefaulted_mb", report.heap_prefaulted_mb},
                {"heap_growth_mb", s.heap_growth_mb},
                {"refusals", Refusals(report)}};
    for (const ThreadGrant& thread : report.threads) {
      realtime["threads"][thread.name] = {{"asked_priority", thread.asked_priority},
                                          {"granted_priority", thread.granted_priority},
                                          {"asked_cpus", ToText(thread.asked_cpus)},
                                          {"granted_cpus", ToText(thread.granted_cpus)},
                                          {"prefaulted_kb", thread.prefaulted_kb}};
    }
  }
  // Names of files need not be UTF-8.
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string ToText(const RunSummary& s) {
  std::string text;
  if (!s.device.empty()) Append(&text, "  device        %5s\n", s.device.c_str());
  Append(&text, "  live coverage %5.1f %%   (%zu of %zu frames were answered with a pose that lasts)\n",
         s.live_coverage, s.live_localised, s.sequence_frames);
  if (s.tracked > s.live_localised) {
    Append(&text, "  given up      %5zu     frames more had a pose at the time, in a map that did not last\n",
           s.tracked - s.live_localised);
  }
  Append(&text, "  coverage      %5.1f %%   (%zu have a pose at the end)\n", s.coverage, s.localised);
  Append(&text, "  maps          %5zu     (%zu begun, %zu merged, %zu loops closed; largest: %zu frames)\n", s.maps,
         s.maps_created, s.merges, s.loops, s.largest_map_frames);
  Append(&text, "  losses        %5zu     (%zu relocalised)\n", s.losses, s.relocalisations);
  Append(&text, "  keyframes     %5zu     (%zu map points)\n", s.keyframes, s.map_points);
  text += ScaleText(s.scene_depths);
  text += MotionText(s.motions);
  if (s.maps_loaded > 0) {
    Append(&text, "  loaded        %5zu     maps of earlier runs (%zu of the keyframes are theirs)\n", s.maps_loaded,
           s.keyframes_loaded);
  }
  if (s.depth) {
    Append(&text, "  depth         %5zu     keyframes have one (%.0f ms each)\n", s.depth->num_keyframes,
           MeanMs(s.depth->counters.search_time, s.depth->counters.num_searches));
  }
  if (s.surface) {
    if (!s.surface->why_not.empty()) text += "  wall          no surface: " + s.surface->why_not + "\n";
    for (const std::string& line : s.surface->lines) text += "  wall          " + line;
  }
  for (const MarkFigures& mark : s.marks) {
    const auto num = [&](MarkState state) { return mark.num_frames[static_cast<std::size_t>(state)]; };
    Append(&text, "  mark          %5zu     frames show %s (hidden in %zu, unsure in %zu)\n", num(MarkState::kInFront),
           mark.label.c_str(), num(MarkState::kHidden), num(MarkState::kUnsure));
  }
  Append(&text, "  frame time    p50 %.1f ms, p99 %.1f ms, p99.9 %.1f ms, max %.1f ms%s\n", s.frame_ms.p50,
         s.frame_ms.p99, s.frame_ms.p999, s.frame_ms.max,
         s.mode == "sequential" ? " (tracking and mapping in turn)" : " (from due to pose)");
  if (s.dropped > 0) Append(&text, "  dropped       %5zu     frames were late\n", s.dropped);
  if (s.realtime) {
    Append(&text, "  late          %5zu     answered after the deadline\n", s.late);
    for (int i = 1; i < kNumRungs; ++i) {
      const std::size_t count = s.on_rung[static_cast<std::size_t>(i)];
      if (count == 0) continue;
      const std::string name(ToString(static_cast<Rung>(i)));
      Append(&text, "  %-13s %5zu     frames went down to this to keep their deadline\n", name.c_str(), count);
    }
  }
  if (s.damaged > 0)
    Append(&text, "  damaged       %5zu     frames could not be read (events.csv names them)\n", s.damaged);
  if (s.interlaced > 0) {
    Append(&text, "  interlaced    %5zu     of %zu pictures: one field of each was used\n", s.interlaced, s.frames);
  }
  const EvictionCounters& evicted = s.evictions;
  if (evicted.num_keyframes + evicted.num_maps + evicted.num_points > 0) {
    Append(&text, "  made room     %5llu     keyframes, %llu maps and %llu points went because a pool was full\n",
           static_cast<unsigned long long>(evicted.num_keyframes), static_cast<unsigned long long>(evicted.num_maps),
           static_cast<unsigned long long>(evicted.num_points));
  }
  for (const PoolFigures& pool : s.pools) {
    // A point has observations enough when its list is full.
    if (pool.refused == 0 || pool.name == "observations_of_a_point") continue;
    Append(&text, "  full          %5llu     times: %s (%llu)\n", static_cast<unsigned long long>(pool.refused),
           pool.name.c_str(), static_cast<unsigned long long>(pool.capacity));
  }
  if (s.is_heap_watched) {
    Append(&text, "  heap          %5u     calls of the tracking thread, %u of them in its first frame\n",
           s.tracking_thread.first_frame.trapped_calls + s.tracking_thread.later.trapped_calls,
           s.tracking_thread.first_frame.trapped_calls);
  }
  if (s.heap_growth_mb > 0.0) {
    Append(&text, "  heap          %5.1f MB  more than was set aside at the start (rt.heap_prefault_mb)\n",
           s.heap_growth_mb);
  }
  Append(&text, "  speed         %.2f times the video's duration (%.1f s for %.1f s), peak memory %.0f MB\n",
         s.realtime_ratio, s.wall_s, s.video_s, s.peak_rss_mb);
  return text;
}

}  // namespace haustra
