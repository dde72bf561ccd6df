#include "tools/evaluate/report_json.h"

#include <nlohmann/json.hpp>

#include "tools/evaluate/run_table.h"

namespace haustra::evaluate {
namespace {

using Json = nlohmann::ordered_json;

template <typename T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json TimesOf(const std::optional<Percentiles>& times) {
  if (!times) return nullptr;
  return {{"p50", times->p50}, {"p99", times->p99}, {"p999", times->p999}, {"max", times->max}};
}

Json CountOf(const JoinCount& count) {
  return {
      {"made", count.made}, {"judged", count.judged}, {"false", count.wrong}, {"precision", OrNull(count.precision())}};
}

Json RecallOf(const std::optional<Recall>& recall) {
  if (!recall) return nullptr;
  return {{"occasions", recall->occasions}, {"taken", recall->taken}, {"recall", OrNull(recall->value())}};
}

Json TableOf(const std::optional<MapTable>& table) {
  if (!table) return nullptr;
  return {{"keyframes", table->keyframes},
          {"map_points", table->map_points},
          {"keyframes_per_s", table->keyframes_per_s},
          {"life_time_s", table->life_time_s},
          {"observations_per_frame", table->observations_per_frame},
          {"observations_per_point", table->observations_per_point}};
}

Json MapOf(const MapEvaluation& map) {
  return {{"map_id", map.map_id},
          {"frames", map.frames},
          {"ate_frames", map.ate_frames},
          {"rms_ate", OrNull(map.rms_ate)},
          {"max", OrNull(map.max_error)},
          {"scene_depth", OrNull(map.scene_depth)},
          {"rms_ate_percent_of_depth", OrNull(map.rms_ate_percent_of_depth)},
          {"scale", OrNull(map.scale)},
          {"scale_drift", OrNull(map.scale_drift)},
          {"keyframes", map.keyframes},
          {"map_points", map.map_points},
          {"keyframes_per_s", map.keyframes_per_s},
          {"life_time_s", map.life_time_s},
          {"observations_per_frame", map.observations_per_frame},
          {"observations_per_point", map.observations_per_point}};
}

Json SegmentOf(const SegmentEvaluation& segment) {
  return {{"begin", segment.begin},
          {"frames", segment.frames},
          {"localised", segment.localised},
          {"rms_ate", OrNull(segment.rms_ate)},
          {"rms_own", OrNull(segment.rms_own)},
          {"own_frames", segment.own_frames}};
}

Json StageOf(const StageEvaluation& stage) {
  return {
      {"stage", stage.stage}, {"count", stage.count},        {"p50", stage.p50}, {"p99", stage.p99}, {"max", stage.max},
      {"mean", stage.mean},   {"deviation", stage.deviation}};
}

Json JoinOf(const JoinEvaluation& join) {
  return {{"kind", ToString(join.kind)},
          {"frame_idx", join.frame_idx},
          {"map_id", join.map_id},
          {"other_map_id", join.other_map_id},
          {"verdict", ToString(join.verdict)},
          {"reason", join.reason},
          {"ate_parts", OrNull(join.ate_parts)},
          {"ate_joined", OrNull(join.ate_joined)},
          {"rotation_error_deg", OrNull(join.rotation_error_deg)},
          {"translation_error_depths", OrNull(join.translation_error_depths)},
          {"ate_joined_depths", OrNull(join.ate_joined_depths)},
          {"duration_ms", OrNull(join.duration_ms)}};
}

Json RunOf(const Evaluation& e) {
  Json json;
  json["run"] = e.name;
  json["mode"] = e.mode;
  json["device"] = e.device;
  json["seed"] = OrNull(e.seed);
  json["unit"] = e.unit;
  json["frames"] = e.frames;
  json["unanswered_frames"] = e.unanswered_frames;
  json["live_localised"] = e.live_localised;
  json["live_coverage"] = e.live_coverage;
  json["localised"] = e.localised;
  json["coverage"] = e.coverage;
  json["visible_frames"] = OrNull(e.visible_frames);
  json["live_visible_localised"] = OrNull(e.live_visible_localised);
  json["live_visible_coverage"] = OrNull(e.live_visible_coverage);
  json["visible_localised"] = OrNull(e.visible_localised);
  json["visible_coverage"] = OrNull(e.visible_coverage);
  json["frames_without_groundtruth"] = e.frames_without_groundtruth;
  json["maps"] = e.maps;
  json["maps_created"] = e.maps_created;
  json["losses"] = e.losses;
  json["merges"] = e.merges.made;
  json["loops"] = e.loops.made;
  json["relocalisations"] = e.relocalisations.made;
  json["recoveries"] = e.recoveries.made;
  json["false_merges"] = e.false_merges;
  json["rms_ate"] = OrNull(e.rms_ate);
  json["max_error"] = OrNull(e.max_error);
  json["ate_frames"] = e.ate_frames;
  json["left_out_maps"] = e.left_out_maps;
  json["left_out_frames"] = e.left_out_frames;
  json["largest_map_frames"] = e.largest_map_frames;
  json["largest_map_rms_ate"] = OrNull(e.largest_map_rms_ate);
  json["largest_map_rms_ate_percent_of_depth"] = OrNull(e.largest_map_rms_ate_percent_of_depth);
  json["keyframes"] = e.keyframes;
  json["map_points"] = e.map_points;
  json["scene_depth"] = OrNull(e.scene_depth);
  json["merge_precision"] = OrNull(e.merges.precision());
  json["loop_precision"] = OrNull(e.loops.precision());
  json["relocalisation_precision"] = OrNull(e.relocalisations.precision());
  json["recovery_precision"] = OrNull(e.recoveries.precision());
  json["merge_recall"] = e.merge_recall ? OrNull(e.merge_recall->value()) : Json(nullptr);
  json["relocalisation_recall"] = e.relocalisation_recall ? OrNull(e.relocalisation_recall->value()) : Json(nullptr);
  json["join_counts"] = {{"merges", CountOf(e.merges)},
                         {"loops", CountOf(e.loops)},
                         {"relocalisations", CountOf(e.relocalisations)},
                         {"recoveries", CountOf(e.recoveries)}};
  json["recall"] = {{"merges", RecallOf(e.merge_recall)}, {"relocalisations", RecallOf(e.relocalisation_recall)}};
  json["frame_ms"] = TimesOf(e.frame_ms);
  json["joining_frames"] = e.joining_frames;
  json["joining_frame_ms"] = TimesOf(e.joining_frame_ms);
  json["other_frame_ms"] = TimesOf(e.other_frame_ms);
  json["deadline_ms"] = OrNull(e.deadline_ms);
  json["deadline_misses"] = OrNull(e.deadline_misses);
  json["dropped"] = e.dropped;
  json["damaged"] = e.damaged;
  json["interlaced"] = e.interlaced;
  json["peak_rss_mb"] = OrNull(e.peak_rss_mb);
  json["realtime_ratio"] = OrNull(e.realtime_ratio);
  json["mean_stage_ms"] = e.mean_stage_ms;
  json["stages"] = Json::array();
  for (const StageEvaluation& stage : e.stages) json["stages"].push_back(StageOf(stage));
  json["mean_map"] = TableOf(e.mean_map);
  json["largest_map"] = TableOf(e.largest_map);
  json["per_map"] = Json::array();
  for (const MapEvaluation& map : e.per_map) json["per_map"].push_back(MapOf(map));
  json["joins"] = Json::array();
  for (const JoinEvaluation& join : e.joins) json["joins"].push_back(JoinOf(join));
  json["segments"] = Json::array();
  for (const SegmentEvaluation& segment : e.segments) json["segments"].push_back(SegmentOf(segment));
  json["warnings"] = e.warnings;
  return json;
}

// Names of folders are bytes, not always UTF-8: what is not is replaced.
std::string Dump(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }

}  // namespace

std::string ToJson(const Evaluation& evaluation) { return Dump(RunOf(evaluation)); }

std::string ToJson(std::span<const Evaluation> evaluations) {
  Json json;
  json["runs"] = Json::array();
  for (const Evaluation& evaluation : evaluations) json["runs"].push_back(RunOf(evaluation));
  json["mean"] = Json::object();
  json["spread"] = Json::object();
  for (const TableRow& row : MakeRunRows(evaluations)) {
    json["mean"][row.metric] = row.spread ? Json(row.spread->mean) : Json(nullptr);
    if (!row.spread) {
      json["spread"][row.metric] = nullptr;
    } else {
      json["spread"][row.metric] = {{"deviation", row.spread->deviation},
                                    {"min", row.spread->min},
                                    {"max", row.spread->max},
                                    {"count", row.spread->count}};
    }
  }
  return Dump(json);
}

}  // namespace haustra::evaluate
