#include "tools/report/chart_data.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "tools/evaluate/statistics.h"
#include "tools/report/base64.h"

namespace haustra::report {
namespace {

using evaluate::Evaluation;
using evaluate::MapEvaluation;
using evaluate::Reference;
using evaluate::RunFrame;
using evaluate::RunOutput;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxPointsPerMap = 5000;
constexpr std::size_t kMaxTruePositions = 4000;

// Segments that are not in a map.
constexpr int kLost = -1, kInitialising = -2, kDropped = -3, kHidden = -4;

// To the microsecond.
double Rounded(double seconds) { return std::round(seconds * 1e6) / 1e6; }

// Plenty for a plot, and short in JSON: five digits of what the largest value is.
class Rounder {
 public:
  explicit Rounder(double largest) : digits_(5 - static_cast<int>(std::ceil(std::log10(std::max(largest, 1e-12))))) {}
  double operator()(double value) const {
    const double scale = std::pow(10.0, std::abs(digits_));
    return digits_ >= 0 ? std::round(value * scale) / scale : std::round(value / scale) * scale;
  }

 private:
  int digits_;
};

double SecondsOf(const RunOutput& run, std::int64_t timestamp_ns) {
  const std::int64_t whole_us = (timestamp_ns - run.frames[0].timestamp_ns) / 1000;
  return static_cast<double>(whole_us) * 1e-6;
}

// --- Coverage.

template <typename ValueOf>
Json Segments(const RunOutput& run, double period_s, ValueOf&& value_of) {
  Json segments = Json::array();
  for (std::size_t i = 0; i < run.frames.size();) {
    const int value = value_of(i);
    std::size_t end = i + 1;
    while (end < run.frames.size() && value_of(end) == value) ++end;
    const double begin_s = SecondsOf(run, run.frames[i].timestamp_ns);
    const double end_s = end < run.frames.size() ? SecondsOf(run, run.frames[end].timestamp_ns)
                                                 : SecondsOf(run, run.frames[end - 1].timestamp_ns) + period_s;
    segments.push_back({Rounded(begin_s), Rounded(end_s), value});
    i = end;
  }
  return segments;
}

int LiveValue(const RunFrame& frame) {
  if (frame.live_map_id >= 0) return frame.live_map_id;
  if (frame.is_dropped) return kDropped;
  return frame.state == "initialising" ? kInitialising : kLost;
}

Json CoverageOf(const RunOutput& run, const Reference& reference, double period_s) {
  Json rows = Json::array();
  if (reference.events) {
    const std::vector<bool> is_clear = FindClearFrames(run.frames, run.figures.part, reference);
    rows.push_back({{"name", "scene hidden"}, {"segments", Segments(run, period_s, [&](std::size_t i) {
                                                 return is_clear[i] ? kLost : kHidden;
                                               })}});
  }
  rows.push_back({{"name", "as answered"},
                  {"segments", Segments(run, period_s, [&](std::size_t i) { return LiveValue(run.frames[i]); })}});
  rows.push_back({{"name", "in the end"}, {"segments", Segments(run, period_s, [&](std::size_t i) {
                                             return run.frames[i].map_id >= 0 ? run.frames[i].map_id : kLost;
                                           })}});
  return rows;
}

Json MarksOf(const RunOutput& run, const Evaluation& evaluation, const std::map<std::int64_t, double>& time_s) {
  Json marks = Json::array();
  const auto add = [&](std::string_view kind, std::int64_t frame_idx, std::string text, std::string_view verdict) {
    if (!time_s.contains(frame_idx)) return;
    marks.push_back(
        {{"kind", kind}, {"t", time_s.at(frame_idx)}, {"frame", frame_idx}, {"text", text}, {"verdict", verdict}});
  };
  for (const evaluate::RunEventRow& event : run.events) {
    if (event.event == "lost") add("loss", event.frame_idx, "map " + std::to_string(event.map_id), "");
  }
  for (const evaluate::JoinEvaluation& join : evaluation.joins) {
    std::string text = "map " + std::to_string(join.map_id);
    if (join.other_map_id >= 0) text += " and " + std::to_string(join.other_map_id);
    add(ToString(join.kind), join.frame_idx, text, ToString(join.verdict));
  }
  return marks;
}

// --- Views.

using Positions = std::vector<Eigen::Vector3d>;

// Whether a position lies with the others: no farther from their middle than so many times the median distance. A map
// may hold points whose distance is not known, and these are anywhere.
class Crowd {
 public:
  explicit Crowd(const Positions& positions) {
    if (positions.empty()) return;
    std::vector<double> values(positions.size());
    for (int axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < positions.size(); ++i) values[i] = positions[i][axis];
      middle_[axis] = evaluate::Median(values);
    }
    for (std::size_t i = 0; i < positions.size(); ++i) values[i] = (positions[i] - middle_).norm();
    reach_ = kFar * evaluate::Median(values);
  }
  // Of positions that are all in one place each is with the others.
  bool Has(const Eigen::Vector3d& position) const { return reach_ == 0.0 || (position - middle_).norm() <= reach_; }

 private:
  static constexpr double kFar = 20.0;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  double reach_ = 0.0;
};

// Axes of largest, middle and smallest extent as rows, the first two pointing to where their largest component is
// positive. Right-handed: what is turned to them is not its mirror image.
Eigen::Matrix3d PrincipalAxes(const Positions& positions, Eigen::Vector3d* centre) {
  *centre = Eigen::Vector3d::Zero();
  if (positions.empty()) return Eigen::Matrix3d::Identity();
  for (const Eigen::Vector3d& p : positions) *centre += p / static_cast<double>(positions.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : positions) scatter += (p - *centre) * (p - *centre).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter);
  Eigen::Matrix3d axes;
  for (int i = 0; i < 2; ++i) {
    Eigen::Vector3d axis = solver.eigenvectors().col(2 - i);
    Eigen::Index largest = 0;
    axis.cwiseAbs().maxCoeff(&largest);
    axes.row(i) = (axis[largest] < 0.0 ? -axis : axis).transpose();
  }
  axes.row(2) = axes.row(0).cross(axes.row(1));
  return axes;
}

struct ShownMap {
  int map_id = -1;
  Sim3 view_from_map;
  std::vector<Positions> lines;  // camera centres; a new line after frames without a pose
  Positions points;
  std::vector<std::uint8_t> rgb;  // three a point
  std::vector<std::string> pin_labels;
  Positions pins;  // one a label
};

ShownMap MakeShownMap(const RunOutput& run, int map_id, const MapModel* model, const Sim3& view_from_map) {
  ShownMap map;
  map.map_id = map_id;
  map.view_from_map = view_from_map;
  bool was_in_map = false;
  for (const RunFrame& frame : run.frames) {
    const bool is_in_map = frame.map_id == map_id;
    if (is_in_map && !was_in_map) map.lines.emplace_back();
    if (is_in_map) map.lines.back().push_back(view_from_map * frame.world_from_cam.translation);
    was_in_map = is_in_map;
  }
  if (model != nullptr) {
    const std::size_t step = (model->points.size() + kMaxPointsPerMap - 1) / kMaxPointsPerMap;
    for (std::size_t i = 0; i < model->points.size(); i += step) {
      map.points.push_back(view_from_map * model->points[i]);
      map.rgb.insert(map.rgb.end(), model->rgb[i].begin(), model->rgb[i].end());
    }
  }
  for (const evaluate::RunMark& mark : run.marks.set) {
    if (mark.map_id != map_id || !mark.position) continue;
    map.pin_labels.push_back(mark.label);
    map.pins.push_back(view_from_map * *mark.position);
  }
  return map;
}

Json ViewJson(const std::string& title, const std::string& unit, const Positions& truth,
              const std::vector<ShownMap>& maps) {
  Positions paths = truth;
  if (paths.empty()) {
    for (const ShownMap& map : maps) {
      for (const Positions& line : map.lines) paths.insert(paths.end(), line.begin(), line.end());
      paths.insert(paths.end(), map.points.begin(), map.points.end());
    }
    const Crowd crowd(paths);
    std::erase_if(paths, [&crowd](const Eigen::Vector3d& p) { return !crowd.Has(p); });
  }
  Eigen::Vector3d centre;
  const Eigen::Matrix3d axes = PrincipalAxes(paths, &centre);
  double largest = 0.0;
  for (const Eigen::Vector3d& p : paths) largest = std::max(largest, (p - centre).norm());
  const Rounder round(largest);
  const auto json_of = [&](const Positions& positions) {
    Json json = Json::array();
    for (const Eigen::Vector3d& p : positions) {
      const Eigen::Vector3d q = axes * (p - centre);
      json.push_back({round(q.x()), round(q.y()), round(q.z())});
    }
    return json;
  };
  Json view = {{"title", title}, {"unit", unit}, {"truth", json_of(truth)}, {"maps", Json::array()}};
  for (const ShownMap& map : maps) {
    Json lines = Json::array();
    for (const Positions& line : map.lines) lines.push_back(json_of(line));
    // Of its mesh, which is in the page as it is. Columns: where the map's axes and its origin come to lie.
    const Eigen::Vector3d origin = axes * (map.view_from_map * Eigen::Vector3d::Zero() - centre);
    Json shown_from_map = Json::array();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        const Eigen::Vector3d end = axes * (map.view_from_map * Eigen::Vector3d::Unit(column) - centre);
        shown_from_map.push_back(end[row] - origin[row]);
      }
      shown_from_map.push_back(origin[row]);
    }
    Json pins = Json::array();
    const Json places = json_of(map.pins);
    for (std::size_t i = 0; i < places.size(); ++i) {
      pins.push_back({{"label", map.pin_labels[i]}, {"position", places[i]}});
    }
    view["maps"].push_back({{"map", map.map_id},
                            {"lines", lines},
                            {"points", json_of(map.points)},
                            {"rgb", ToBase64(map.rgb)},
                            {"shown_from_map", shown_from_map},
                            {"pins", pins}});
  }
  return view;
}

const MapModel* ModelOf(const std::map<int, MapModel>& models, int map_id) {
  const auto found = models.find(map_id);
  return found == models.end() ? nullptr : &found->second;
}

Json ViewsOf(const RunOutput& run, const Reference& reference, const Evaluation& evaluation,
             const std::map<int, MapModel>& models) {
  std::vector<ShownMap> aligned;
  std::vector<const MapEvaluation*> alone;
  for (const MapEvaluation& map : evaluation.per_map) {
    if (map.truth_from_map) {
      aligned.push_back(MakeShownMap(run, map.map_id, ModelOf(models, map.map_id), *map.truth_from_map));
    } else {
      alone.push_back(&map);
    }
  }
  Json views = Json::array();
  if (!aligned.empty()) {
    Positions truth;
    const std::size_t step = (reference.poses.size() + kMaxTruePositions - 1) / kMaxTruePositions;
    for (std::size_t i = 0; i < reference.poses.size(); i += step) {
      const auto& p = reference.poses[i].position_in_world;
      truth.emplace_back(p[0], p[1], p[2]);
    }
    views.push_back(
        ViewJson("Maps in the frame of the ground truth, each by its own Sim(3)", evaluation.unit, truth, aligned));
  }
  std::stable_sort(alone.begin(), alone.end(),
                   [](const MapEvaluation* a, const MapEvaluation* b) { return a->frames > b->frames; });
  for (std::size_t i = 0; i < std::min(alone.size(), kMaxMapsOnTheirOwn); ++i) {
    const int map_id = alone[i]->map_id;
    views.push_back(ViewJson("Map " + std::to_string(map_id) + " in its own frame and scale (not aligned)", "map units",
                             {}, {MakeShownMap(run, map_id, ModelOf(models, map_id), Sim3())}));
  }
  return views;
}

Json ErrorsOf(const RunOutput& run, const Reference& reference, const Evaluation& evaluation) {
  const std::vector<std::optional<SE3>> truth = Associate(run.frames, reference.poses);
  Json errors = Json::array();
  for (const MapEvaluation& map : evaluation.per_map) {
    if (!map.truth_from_map) continue;
    const Rounder round(map.max_error.value_or(1.0));
    Json samples = Json::array();
    for (std::size_t i = 0; i < run.frames.size(); ++i) {
      if (run.frames[i].map_id != map.map_id || !truth[i]) continue;
      const Eigen::Vector3d centre = *map.truth_from_map * run.frames[i].world_from_cam.translation;
      samples.push_back(
          {Rounded(SecondsOf(run, run.frames[i].timestamp_ns)), round((centre - truth[i]->translation).norm())});
    }
    errors.push_back({{"map", map.map_id}, {"samples", samples}});
  }
  return errors;
}

Json TimesOf(const RunOutput& run, const Evaluation& evaluation, const std::map<std::int64_t, double>& time_s) {
  Json stages = Json::array();
  for (const evaluate::StageEvaluation& stage : evaluation.stages) {
    Json samples = Json::array();
    for (const evaluate::StageTime& time : run.times) {
      if (time.stage != stage.stage || !time_s.contains(time.frame_idx)) continue;
      samples.push_back({time_s.at(time.frame_idx), std::round(time.ms * 1e3) / 1e3});
    }
    stages.push_back(
        {{"stage", stage.stage}, {"p50", stage.p50}, {"p99", stage.p99}, {"max", stage.max}, {"samples", samples}});
  }
  return stages;
}

}  // namespace

std::string MakeChartData(const RunOutput& run, const Reference& reference, const Evaluation& evaluation,
                          const std::map<int, MapModel>& models) {
  const double period_s = static_cast<double>(evaluate::FramePeriodNs(run.frames)) * 1e-9;
  std::map<std::int64_t, double> time_s;
  for (const RunFrame& frame : run.frames) time_s[frame.frame_idx] = Rounded(SecondsOf(run, frame.timestamp_ns));
  Json json;
  json["duration_s"] = SecondsOf(run, run.frames.back().timestamp_ns) + period_s;
  json["mode"] = evaluation.mode;
  json["unit"] = evaluation.unit;
  json["deadline_ms"] = evaluation.deadline_ms ? Json(*evaluation.deadline_ms) : Json(nullptr);
  json["coverage"] = CoverageOf(run, reference, period_s);
  json["marks"] = MarksOf(run, evaluation, time_s);
  json["views"] = ViewsOf(run, reference, evaluation, models);
  json["errors"] = ErrorsOf(run, reference, evaluation);
  json["times"] = TimesOf(run, evaluation, time_s);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace haustra::report
