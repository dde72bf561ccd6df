#include "tools/run/run_summary.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

namespace haustra {
namespace {

// Nearest rank.
double Percentile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return 0.0;
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

double PeakRssMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
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

}  // namespace

std::vector<FinalPose> ResolveAll(const RunRecord& record, const Engine& engine) {
  std::vector<FinalPose> poses(record.frames().size());
  std::map<std::uint32_t, std::size_t> position;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const FrameResult& result = record.frames()[i].result;
    position[result.frame_index] = i;
    poses[i].is_localised = engine.Resolve(result, &poses[i].pose);
    if (poses[i].is_localised) poses[i].keyframe = result.reference_keyframe;
  }
  const Atlas& atlas = engine.atlas();
  for (KeyframeId id = 0; id < atlas.num_keyframe_ids(); ++id) {
    if (!atlas.IsOfThisSession(id)) continue;
    const auto it = position.find(atlas.FrameOfKeyframe(id));
    if (it == position.end() || poses[it->second].is_localised) continue;
    FinalPose& pose = poses[it->second];
    pose.is_localised = atlas.Resolve(id, SE3{}, atlas.ScaleOfKeyframe(id), &pose.pose);
    if (pose.is_localised) pose.keyframe = id;
  }
  return poses;
}

RunSummary Summarise(const RunRecord& record, const std::vector<FinalPose>& poses, const Engine& engine,
                     const SessionSummary& session) {
  RunSummary summary;
  summary.frames = record.frames().size();
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
  if (summary.frames > 0)
    summary.coverage = 100.0 * static_cast<double>(summary.localised) / static_cast<double>(summary.frames);
  for (const RunEvent& event : record.events()) {
    summary.maps_created += event.event == ToString(MapEventKind::kMapCreated);
    summary.merges += event.event == ToString(MapEventKind::kMerged);
    summary.loops += event.event == ToString(MapEventKind::kLoopClosed);
  }
  summary.relocalisations = record.num_relocalisations();
  summary.losses = record.num_losses();
  summary.dropped = record.num_dropped();
  summary.damaged = record.num_damaged();
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
  summary.frame_ms = {Percentile(latency, 0.5), Percentile(latency, 0.99), Percentile(latency, 0.999),
                      latency.empty() ? 0.0 : latency.back()};
  summary.peak_rss_mb = PeakRssMb();
  summary.video_s = ToSeconds(session.video_time);
  summary.wall_s = ToSeconds(session.wall_time);
  if (summary.video_s > 0) summary.realtime_ratio = summary.wall_s / summary.video_s;
  summary.mapping = engine.mapper_counters();
  return summary;
}

std::string ToJson(const RunSummary& s) {
  nlohmann::ordered_json json;
  json["mode"] = s.mode;
  json["device"] = s.device;
  json["seed"] = s.seed;
  json["frames"] = s.frames;
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
  json["peak_rss_mb"] = s.peak_rss_mb;
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
                     {"foundings_refused", m.num_foundings_refused},
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
  return json.dump(2) + "\n";
}

std::string ToText(const RunSummary& s) {
  std::string text;
  Append(&text, "  coverage      %5.1f %%   (%zu of %zu frames have a pose)\n", s.coverage, s.localised, s.frames);
  Append(&text, "  maps          %5zu     (%zu begun, %zu merged, %zu loops closed; largest: %zu frames)\n", s.maps,
         s.maps_created, s.merges, s.loops, s.largest_map_frames);
  Append(&text, "  losses        %5zu     (%zu relocalised)\n", s.losses, s.relocalisations);
  Append(&text, "  keyframes     %5zu     (%zu map points)\n", s.keyframes, s.map_points);
  if (s.maps_loaded > 0) {
    Append(&text, "  loaded        %5zu     maps of earlier runs (%zu of the keyframes are theirs)\n", s.maps_loaded,
           s.keyframes_loaded);
  }
  Append(&text, "  frame time    p50 %.1f ms, p99 %.1f ms, p99.9 %.1f ms, max %.1f ms%s\n", s.frame_ms.p50,
         s.frame_ms.p99, s.frame_ms.p999, s.frame_ms.max,
         s.mode == "sequential" ? " (tracking and mapping in turn)" : " (from due to pose)");
  if (s.dropped > 0) Append(&text, "  dropped       %5zu     frames were late\n", s.dropped);
  if (s.damaged > 0)
    Append(&text, "  damaged       %5zu     frames could not be read (events.csv names them)\n", s.damaged);
  Append(&text, "  speed         %.2f times the video's duration (%.1f s for %.1f s), peak memory %.0f MB\n",
         s.realtime_ratio, s.wall_s, s.video_s, s.peak_rss_mb);
  return text;
}

}  // namespace haustra
