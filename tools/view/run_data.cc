#include "tools/view/run_data.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <unordered_map>

#include "tools/evaluate/paper_tables.h"
#include "tools/evaluate/reference.h"
#include "tools/view/column.h"

namespace haustra::view {
namespace {

using evaluate::RunFrame;
using evaluate::RunOutput;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxPointsPerMap = 60000;
// Of the rest there may be a row for every keyframe.
constexpr std::size_t kMaxEvents = 2000;
constexpr std::uint8_t kNotTracked = 255;

// Of each frame in ms, NaN where nobody measured it. A run in real time says it frame by frame; of a sequential one it
// is what the frame took.
std::vector<float> LatenciesOf(const RunOutput& run) {
  std::unordered_map<std::int64_t, double> measured_ms;
  for (const evaluate::StageTime& time : run.times) {
    if (time.stage == "frame/total") measured_ms[time.frame_idx] = time.ms;
    if (time.stage == "tracking/total") measured_ms.try_emplace(time.frame_idx, time.ms);
  }
  std::vector<float> latencies_ms;
  for (const RunFrame& frame : run.frames) {
    const auto found = measured_ms.find(frame.frame_idx);
    const double ms = frame.frame_ms > 0.0         ? frame.frame_ms
                      : found != measured_ms.end() ? found->second
                                                   : std::numeric_limits<double>::quiet_NaN();
    latencies_ms.push_back(static_cast<float>(ms));
  }
  return latencies_ms;
}

Json FramesOf(const RunOutput& run, const std::vector<std::string>& states) {
  std::vector<std::int32_t> index, map, live_map, inliers;
  std::vector<std::uint8_t> state;
  std::vector<float> time_s, position, orientation;
  for (const RunFrame& frame : run.frames) {
    index.push_back(static_cast<std::int32_t>(frame.frame_idx));
    time_s.push_back(static_cast<float>(static_cast<double>(frame.timestamp_ns - run.frames[0].timestamp_ns) * 1e-9));
    map.push_back(frame.map_id);
    live_map.push_back(frame.live_map_id);
    inliers.push_back(frame.num_inliers);
    state.push_back(static_cast<std::uint8_t>(std::find(states.begin(), states.end(), frame.state) - states.begin()));
    const bool has_pose = frame.map_id >= 0;
    for (int i = 0; i < 3; ++i) {
      position.push_back(has_pose ? static_cast<float>(frame.world_from_cam.translation[i]) : 0.0f);
    }
    for (int i = 0; i < 4; ++i) {
      orientation.push_back(has_pose ? static_cast<float>(frame.world_from_cam.rotation.coeffs()[i]) : 0.0f);
    }
  }
  return {{"index", Column(index)},
          {"time_s", Column(time_s)},
          {"map", Column(map)},
          {"live_map", Column(live_map)},
          {"state", Column(state)},
          {"inliers", Column(inliers)},
          {"latency_ms", Column(LatenciesOf(run))},
          {"position", Column(position)},
          {"orientation", Column(orientation)}};
}

Json MapOf(const evaluate::RunMap& map, const report::MapModel& model, const ShownWall& wall) {
  std::vector<float> points;
  std::vector<std::uint8_t> rgb;
  const std::size_t count = std::min(model.points.size(), kMaxPointsPerMap);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = i * model.points.size() / count;
    for (int axis = 0; axis < 3; ++axis) points.push_back(static_cast<float>(model.points[k][axis]));
    rgb.insert(rgb.end(), model.rgb[k].begin(), model.rgb[k].end());
  }
  return {{"id", map.map_id},
          {"status", map.status},
          {"keyframes", map.num_keyframes},
          {"num_points", model.points.size()},
          {"points", Column(points)},
          {"rgb", Column(rgb)},
          {"surface", wall.mesh.empty() ? Json(nullptr) : Json(wall.mesh)},
          {"wall", wall.coverage.empty() ? Json(nullptr) : Json::parse(wall.coverage)}};
}

// *num_events: those that the page would show if there were fewer.
Json EventsOf(const RunOutput& run, std::size_t* num_events) {
  Json events = Json::array();
  for (const evaluate::RunEventRow& event : run.events) {
    if (event.event == "merge_rejected" || event.event == "frame_not_found") continue;
    if (++*num_events > kMaxEvents) continue;
    events.push_back({{"frame", event.frame_idx},
                      {"event", event.event},
                      {"map", event.map_id},
                      {"other_map", event.other_map_id},
                      {"details", event.details}});
  }
  return events;
}

Json MarksOf(const RunOutput& run, const std::vector<std::string>& states) {
  const std::vector<evaluate::RunMark>& marks = run.marks.set;
  std::unordered_map<std::int64_t, std::size_t> rows;  // by frame
  for (std::size_t row = 0; row < run.frames.size(); ++row) rows[run.frames[row].frame_idx] = row;
  std::vector<std::vector<std::uint8_t>> state(marks.size(), std::vector(run.frames.size(), kNotTracked));
  std::vector<std::vector<float>> distance(marks.size(), std::vector(run.frames.size(), 0.0f));
  for (const evaluate::RunMarkSighting& sighting : run.marks.sightings) {
    const auto row = rows.find(sighting.frame_idx);
    if (row == rows.end()) continue;
    const auto word = std::find(states.begin(), states.end(), sighting.state);
    state[sighting.mark][row->second] = static_cast<std::uint8_t>(word - states.begin());
    distance[sighting.mark][row->second] = static_cast<float>(sighting.distance_in_depths);
  }
  Json json = Json::array();
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const std::optional<Eigen::Vector3d>& position = marks[i].position;
    json.push_back({{"label", marks[i].label},
                    {"map", marks[i].map_id},
                    {"position", position ? Json{position->x(), position->y(), position->z()} : Json(nullptr)},
                    {"frame", marks[i].is_of_this_run ? marks[i].frame_idx : -1},
                    {"state", Column(state[i])},
                    {"distance", Column(distance[i])}});
  }
  return json;
}

// Each word once, in the order of their first coming.
template <typename Rows>
std::vector<std::string> StatesOf(const Rows& rows) {
  std::vector<std::string> states;
  for (const auto& row : rows) {
    if (std::find(states.begin(), states.end(), row.state) == states.end()) states.push_back(row.state);
  }
  return states;
}

}  // namespace

std::string MakeRunData(const RunOutput& run, const std::map<int, report::MapModel>& models,
                        const std::map<int, ShownWall>& walls) {
  const std::vector<std::string> states = StatesOf(run.frames), mark_states = StatesOf(run.marks.sightings);
  Json json;
  json["name"] = evaluate::ShortName(run.folder);
  json["mode"] = run.figures.mode;
  json["device"] = run.figures.device;
  json["period_ms"] = static_cast<double>(evaluate::FramePeriodNs(run.frames)) * 1e-6 / run.figures.rate.value_or(1.0);
  json["states"] = states;
  json["maps"] = Json::array();
  for (const evaluate::RunMap& map : run.maps) {
    const auto model = models.find(map.map_id);
    if (model == models.end()) continue;
    const auto wall = walls.find(map.map_id);
    json["maps"].push_back(MapOf(map, model->second, wall == walls.end() ? ShownWall() : wall->second));
  }
  json["frames"] = FramesOf(run, states);
  std::size_t num_events = 0;
  json["events"] = EventsOf(run, &num_events);
  json["num_events"] = num_events;
  json["mark_states"] = mark_states;
  json["marks"] = MarksOf(run, mark_states);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace haustra::view
