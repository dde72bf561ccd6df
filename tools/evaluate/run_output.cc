#include "tools/evaluate/run_output.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <type_traits>

#include "capture/ground_truth.h"
#include "tools/evaluate/colmap_reader.h"
#include "tools/evaluate/csv_table.h"
#include "tools/evaluate/json_input.h"
#include "tools/evaluate/number_text.h"
#include "tools/evaluate/text_input.h"
#include "tools/run/map_name.h"

namespace haustra::evaluate {
namespace {

namespace fs = std::filesystem;

// Trajectories carry nanoseconds; other writers of the format round to microseconds.
constexpr std::int64_t kSameStampNs = 1000;

// What a run writes, from end to end.
struct IntegerRange {
  std::int64_t low = 0, high = 0;
};
// Of frames, eleven days at 100 Hz: a greater index is no frame of a recording.
constexpr IntegerRange kFrameRange{0, 100'000'000};
constexpr IntegerRange kKeyframeRange{-1, std::numeric_limits<std::uint32_t>::max()};
constexpr IntegerRange kMapRange{-1, std::numeric_limits<int>::max()};
constexpr IntegerRange kCountRange{0, std::numeric_limits<int>::max()};
// Until 2116, counted from 1970; so that times can be subtracted.
constexpr IntegerRange kStampRange{-(std::int64_t{1} << 61), std::int64_t{1} << 62};

// Copies table fields into plain variables; the first error stays and ends the reading of the row.
class RowReader {
 public:
  RowReader(const CsvTable& table, std::size_t row) : table_(table), row_(row) {}

  template <typename T>
  RowReader& Integer(std::size_t column, IntegerRange range, T* value) {
    if (!status_.ok()) return *this;
    if (const Result<std::int64_t> field = table_.Integer(row_, column); !field.ok()) {
      status_ = field.status();
    } else if (*field < range.low || *field > range.high) {
      status_ = InvalidArgument(table_.Where(row_) + table_.column(column) + " is " + std::to_string(*field) +
                                ", not from " + std::to_string(range.low) + " to " + std::to_string(range.high));
    } else {
      *value = static_cast<T>(*field);
    }
    return *this;
  }
  RowReader& Number(std::size_t column, double* value) {
    if (!status_.ok()) return *this;
    if (const Result<double> field = table_.Number(row_, column); field.ok()) {
      *value = *field;
    } else {
      status_ = field.status();
    }
    return *this;
  }
  const Status& status() const { return status_; }

 private:
  const CsvTable& table_;
  std::size_t row_;
  Status status_;
};

Status ReadFrames(const std::string& path, std::vector<RunFrame>* frames) {
  HAUSTRA_ASSIGN(const CsvTable table,
                 CsvTable::Read(path, {"frame_idx", "timestamp_ns", "state", "reason", "live_map_id", "map_id",
                                       "keyframe_id", "num_inliers", "frame_ms"}));
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    RunFrame frame;
    RowReader reader(table, row);
    reader.Integer(0, kFrameRange, &frame.frame_idx).Integer(1, kStampRange, &frame.timestamp_ns);
    reader.Integer(4, kMapRange, &frame.live_map_id).Integer(5, kMapRange, &frame.map_id);
    reader.Integer(6, kKeyframeRange, &frame.keyframe_id).Integer(7, kCountRange, &frame.num_inliers);
    HAUSTRA_TRY(reader.Number(8, &frame.frame_ms).status());
    frame.state = table.Text(row, 2);
    frame.reason = table.Text(row, 3);
    frame.is_dropped = frame.state == "dropped";
    frame.is_damaged = frame.reason == "damaged_frame";
    if (!frames->empty() && frame.frame_idx <= frames->back().frame_idx) {
      return InvalidArgument(table.Where(row) + "frame_idx " + std::to_string(frame.frame_idx) +
                             " does not come after " + std::to_string(frames->back().frame_idx));
    }
    frames->push_back(frame);
  }
  if (frames->empty()) return InvalidArgument(path + ": no frames");
  return Status::Ok();
}

Status ReadMaps(const std::string& path, std::vector<RunMap>* maps) {
  HAUSTRA_ASSIGN(const CsvTable table,
                 CsvTable::Read(path, {"map_id", "status", "num_keyframes", "num_points", "merged_into"}));
  std::set<int> ids;
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    RunMap map;
    RowReader reader(table, row);
    reader.Integer(0, kCountRange, &map.map_id).Integer(2, kCountRange, &map.num_keyframes);
    reader.Integer(3, kCountRange, &map.num_points).Integer(4, kMapRange, &map.merged_into);
    HAUSTRA_TRY(reader.status());
    map.status = table.Text(row, 1);
    if (!ids.insert(map.map_id).second) {
      return InvalidArgument(table.Where(row) + "map_id " + std::to_string(map.map_id) + " is there twice");
    }
    maps->push_back(std::move(map));
  }
  return Status::Ok();
}

Status ReadEvents(const std::string& path, std::vector<RunEventRow>* events) {
  HAUSTRA_ASSIGN(const CsvTable table,
                 CsvTable::Read(path, {"frame_idx", "event", "map_id", "other_map_id", "details"}));
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    RunEventRow event;
    RowReader reader(table, row);
    reader.Integer(0, kFrameRange, &event.frame_idx).Integer(2, kMapRange, &event.map_id);
    reader.Integer(3, kMapRange, &event.other_map_id);
    HAUSTRA_TRY(reader.status());
    event.event = table.Text(row, 1);
    event.details = table.Text(row, 4);
    event.other_keyframe_id = DetailOf(event, "other_keyframe");
    events->push_back(std::move(event));
  }
  std::stable_sort(events->begin(), events->end(),
                   [](const RunEventRow& a, const RunEventRow& b) { return a.frame_idx < b.frame_idx; });
  return Status::Ok();
}

// Not there: a run that was not timed.
Status ReadTimes(const std::string& path, std::vector<StageTime>* times) {
  std::error_code error;
  if (!fs::exists(path, error)) return Status::Ok();
  HAUSTRA_ASSIGN(const CsvTable table, CsvTable::Read(path, {"frame_idx", "stage", "ms"}));
  times->reserve(table.num_rows());
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    StageTime time;
    RowReader reader(table, row);
    HAUSTRA_TRY(reader.Integer(0, kFrameRange, &time.frame_idx).Number(2, &time.ms).status());
    time.stage = table.Text(row, 1);
    if (time.ms < 0.0) return InvalidArgument(table.Where(row) + "ms is " + table.Text(row, 2) + ", below zero");
    times->push_back(std::move(time));
  }
  return Status::Ok();
}

SE3 ToSE3(const GroundTruthPose& pose) {
  const auto& q = pose.world_from_cam_xyzw;
  const auto& p = pose.position_in_world;
  return SE3(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), Eigen::Vector3d(p[0], p[1], p[2]));
}

// Gives the frames of one map their final poses; returns how many have none.
std::size_t AssignPoses(const std::vector<GroundTruthPose>& poses, int map_id, std::vector<RunFrame>* frames) {
  std::size_t num_missing = 0;
  for (RunFrame& frame : *frames) {
    if (frame.map_id != map_id) continue;
    const auto found = std::lower_bound(
        poses.begin(), poses.end(), frame.timestamp_ns - kSameStampNs,
        [](const GroundTruthPose& pose, std::int64_t stamp_ns) { return pose.timestamp_ns < stamp_ns; });
    if (found == poses.end() || found->timestamp_ns > frame.timestamp_ns + kSameStampNs) {
      frame.map_id = -1;
      ++num_missing;
    } else {
      frame.world_from_cam = ToSE3(*found);
    }
  }
  return num_missing;
}

Status ReadTrajectories(RunOutput* run) {
  std::set<int> map_ids;
  for (const RunFrame& frame : run->frames) {
    if (frame.map_id >= 0) map_ids.insert(frame.map_id);
  }
  for (const int map_id : map_ids) {
    const auto is_it = [map_id](const RunMap& map) { return map.map_id == map_id; };
    if (std::none_of(run->maps.begin(), run->maps.end(), is_it)) {
      return InvalidArgument((fs::path(run->folder) / "maps.csv").string() + ": map " + std::to_string(map_id) +
                             " is missing, into which frames.csv puts frames");
    }
    const std::string path = (fs::path(run->folder) / "trajectory" / (MapName(map_id) + ".tum")).string();
    HAUSTRA_ASSIGN(const std::vector<GroundTruthPose> poses, ReadGroundTruth(path));
    const std::size_t num_missing = AssignPoses(poses, map_id, &run->frames);
    if (num_missing > 0) {
      run->warnings.push_back(path + ": no pose for " + std::to_string(num_missing) +
                              " frames that frames.csv puts into this map; they count as not localised");
    }
  }
  return Status::Ok();
}

Status ReadGeometry(RunOutput* run) {
  for (const RunMap& map : run->maps) {
    const fs::path folder = fs::path(run->folder) / "maps" / MapName(map.map_id);
    std::error_code error;
    if (!fs::is_directory(folder, error)) continue;
    HAUSTRA_ASSIGN(run->geometry[map.map_id], ReadColmapGeometry(folder.string()));
  }
  return Status::Ok();
}

template <typename T>
std::optional<T> NumberAt(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end()) return std::nullopt;
  if constexpr (std::is_integral_v<T>) {
    return IntegerOf<T>(*found);
  } else {
    return found->is_number() ? std::optional<T>(found->template get<T>()) : std::nullopt;
  }
}

std::string TextAt(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

Status ReadMotions(const std::string& path, const nlohmann::json& json, std::vector<MapMotionRow>* motions) {
  if (!json.contains("periodic_motion")) return Status::Ok();
  try {
    for (const nlohmann::json& entry : json.at("periodic_motion")) {
      MapMotionRow& motion = motions->emplace_back();
      motion.map_id = IntegerAt<int>(entry, "map_id");
      motion.longest_period_s = entry.at("longest_period_s").get<double>();
      for (const nlohmann::json& found : entry.at("found")) {
        motion.found.push_back({found.at("from_s").get<double>(), found.at("to_s").get<double>(),
                                found.at("period_s").get<double>(), found.at("amplitude_percent").get<double>(),
                                found.at("chance").get<double>()});
      }
    }
  } catch (const std::exception& error) {
    return InvalidArgument(path + ": periodic_motion: " + error.what());
  }
  return Status::Ok();
}

// Of maps that have lost their scale, what a reader must know.
Status ReadScales(const std::string& path, const nlohmann::json& json, std::vector<std::string>* warnings) {
  if (!json.contains("scene_depth")) return Status::Ok();
  try {
    for (const nlohmann::json& entry : json.at("scene_depth")) {
      const auto map_id = IntegerAt<int>(entry, "map_id");
      const double range = entry.at("p95").get<double>() / entry.at("p5").get<double>();
      if (!(range >= 1.0) || !std::isfinite(range)) {
        return InvalidArgument(path + ": scene_depth: p5 and p95 of map " + std::to_string(map_id) + " are no depths");
      }
      if (!entry.at("scale_lost").get<bool>()) continue;
      warnings->push_back("map " + std::to_string(map_id) + " has lost its scale: what it sees is " + Fixed(range, 0) +
                          " times as far away in one part as in another, so its lengths do not compare");
    }
  } catch (const std::exception& error) {
    return InvalidArgument(path + ": scene_depth: " + error.what());
  }
  return Status::Ok();
}

Status ReadFigures(const std::string& path, RunFigures* figures) {
  HAUSTRA_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  figures->mode = TextAt(json, "mode");
  figures->device = TextAt(json, "device");
  if (const auto found = json.find("calibration"); found != json.end() && found->is_object()) {
    figures->calibration_note = TextAt(*found, "note");
  }
  figures->seed = NumberAt<std::int64_t>(json, "seed");
  figures->part.first_frame = NumberAt<std::uint32_t>(json, "first_frame").value_or(0);
  figures->part.every_nth = NumberAt<std::uint32_t>(json, "every_nth").value_or(1);
  if (const Status status = figures->part.Validate(); !status.ok()) {
    return InvalidArgument(path + ": " + status.message());
  }
  figures->frames = NumberAt<std::uint32_t>(json, "frames");
  figures->sequence_frames = NumberAt<std::uint32_t>(json, "sequence_frames");
  figures->dropped = NumberAt<std::uint32_t>(json, "dropped");
  figures->interlaced = NumberAt<std::uint32_t>(json, "interlaced");
  figures->deadline_misses = NumberAt<std::uint32_t>(json, "deadline_misses");
  figures->peak_rss_mb = NumberAt<double>(json, "peak_rss_mb");
  figures->realtime_ratio = NumberAt<double>(json, "realtime_ratio");
  figures->rate = NumberAt<double>(json, "rate");
  if (figures->rate && !(*figures->rate > 0.0)) return InvalidArgument(path + ": rate must be above 0");
  if (const auto times = json.find("frame_ms"); times != json.end() && times->is_object()) {
    const auto p50 = NumberAt<double>(*times, "p50"), p99 = NumberAt<double>(*times, "p99");
    const auto p999 = NumberAt<double>(*times, "p999"), max = NumberAt<double>(*times, "max");
    if (!p50 || !p99 || !p999 || !max) {
      return InvalidArgument(path + ": frame_ms lacks one of the numbers p50, p99, p999, max");
    }
    figures->frame_ms = Percentiles{*p50, *p99, *p999, *max};
  }
  const nlohmann::json::json_pointer stages("/mapping/mean_ms");
  if (json.contains(stages) && json[stages].is_object()) {
    for (const auto& [name, value] : json[stages].items()) {
      if (value.is_number()) figures->mean_stage_ms[name] = value.get<double>();
    }
  }
  HAUSTRA_TRY(ReadScales(path, json, &figures->scale_warnings));
  return ReadMotions(path, json, &figures->motions);
}

}  // namespace

std::optional<std::int64_t> DetailOf(const RunEventRow& event, std::string_view name) {
  for (const std::string_view word : SplitBlanks(event.details)) {
    if (word.starts_with(name) && word.substr(name.size()).starts_with('=')) {
      return ParseInteger(word.substr(name.size() + 1));
    }
  }
  return std::nullopt;
}

Result<RunOutput> ReadRunOutput(const std::string& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    const bool is_gone = !error || error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory;
    return is_gone ? NotFound(folder + ": no such folder")
                   : Unavailable(folder + ": cannot be reached: " + error.message());
  }
  const auto path = [&](const char* name) { return (fs::path(folder) / name).string(); };
  RunOutput run;
  run.folder = folder;
  HAUSTRA_TRY(ReadFrames(path("frames.csv"), &run.frames));
  HAUSTRA_TRY(ReadMaps(path("maps.csv"), &run.maps));
  HAUSTRA_TRY(ReadEvents(path("events.csv"), &run.events));
  HAUSTRA_TRY(ReadTimes(path("times.csv"), &run.times));
  HAUSTRA_TRY(ReadFigures(path("summary.json"), &run.figures));
  HAUSTRA_ASSIGN(run.marks, ReadRunMarks(folder));
  if (!run.figures.calibration_note.empty()) run.warnings.push_back(run.figures.calibration_note);
  for (const std::string& warning : run.figures.scale_warnings) run.warnings.push_back(warning);
  HAUSTRA_TRY(ReadTrajectories(&run));
  HAUSTRA_TRY(ReadGeometry(&run));
  if (run.figures.frames && *run.figures.frames != static_cast<std::int64_t>(run.frames.size())) {
    run.warnings.push_back(path("summary.json") + ": says " + std::to_string(*run.figures.frames) +
                           " frames, frames.csv has " + std::to_string(run.frames.size()));
  }
  return run;
}

}  // namespace haustra::evaluate
