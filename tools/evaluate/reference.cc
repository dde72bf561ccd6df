#include "tools/evaluate/reference.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "capture/files/whole_file.h"
#include "tools/evaluate/csv_table.h"
#include "tools/evaluate/text_input.h"

namespace haustra::evaluate {
namespace {

namespace fs = std::filesystem;

Result<std::vector<SequenceEvent>> ReadSequenceEvents(const std::string& path) {
  HAUSTRA_ASSIGN(const CsvTable table, CsvTable::Read(path, {"first_frame", "last_frame", "kind", "visible"}));
  std::vector<SequenceEvent> events;
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    SequenceEvent event;
    HAUSTRA_ASSIGN(event.first_frame, table.Integer(row, 0));
    HAUSTRA_ASSIGN(event.last_frame, table.Integer(row, 1));
    HAUSTRA_ASSIGN(const std::int64_t visible, table.Integer(row, 3));
    event.kind = table.Text(row, 2);
    if (event.first_frame < 0 || event.last_frame < event.first_frame) {
      return InvalidArgument(table.Where(row) + "frames " + std::to_string(event.first_frame) + " to " +
                             std::to_string(event.last_frame) + " are no range");
    }
    if (visible != 0 && visible != 1) {
      return InvalidArgument(table.Where(row) + "visible is " + std::to_string(visible) + ", not 0 or 1");
    }
    event.is_visible = visible == 1;
    events.push_back(std::move(event));
  }
  return events;
}

// A run's own events.csv has other columns: a file that is not about visibility is not an error when nobody named it.
bool HasEventColumns(const std::string& path) {
  const Result<std::string> text = ReadWholeText(path);
  if (!text.ok()) return false;
  for (const std::string_view line : SplitLines(*text)) {
    if (SplitBlanks(line).empty() || line.front() == '#') continue;
    const std::vector<std::string_view> names = SplitFields(line, ',');
    const auto has = [&](std::string_view name) { return std::find(names.begin(), names.end(), name) != names.end(); };
    return has("first_frame") && has("visible");
  }
  return false;
}

Result<std::vector<std::int64_t>> ReadFrameTimes(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  std::vector<std::int64_t> stamps;
  std::size_t number = 0;
  for (const std::string_view line : SplitLines(text)) {
    ++number;
    const std::vector<std::string_view> fields = SplitBlanks(line);
    if (fields.empty() || fields[0].starts_with('#')) continue;
    const std::optional<double> seconds = ParseNumber(fields[0]);
    if (!seconds) {
      return InvalidArgument(path + ":" + std::to_string(number) + ": '" + std::string(fields[0]) + "' is not a time");
    }
    stamps.push_back(static_cast<std::int64_t>(std::llround(*seconds * 1e9)));
    if (stamps.size() > 1 && stamps.back() <= stamps[stamps.size() - 2]) {
      return InvalidArgument(path + ":" + std::to_string(number) + ": time does not come after the one before");
    }
  }
  return stamps;
}

// The first word of the comments above the poses that names a unit of length.
std::string UnitOf(std::string_view text) {
  for (const std::string_view line : SplitLines(text)) {
    if (!line.starts_with('#')) break;
    std::string word;
    for (const char c : std::string(line) + ' ') {
      if (std::isalpha(static_cast<unsigned char>(c)) != 0) {
        word += c;
        continue;
      }
      if (word == "mm" || word.starts_with("millimet")) return "mm";
      if (word == "metres" || word == "meters") return "m";
      word.clear();
    }
  }
  return "units";
}

// Position of the element nearest to `stamp_ns`; `stamps` is not empty.
std::size_t Nearest(const std::vector<std::int64_t>& stamps, std::int64_t stamp_ns) {
  const auto after = std::lower_bound(stamps.begin(), stamps.end(), stamp_ns);
  if (after == stamps.begin()) return 0;
  if (after == stamps.end() || stamp_ns - *(after - 1) <= *after - stamp_ns) {
    return static_cast<std::size_t>(after - stamps.begin()) - 1;
  }
  return static_cast<std::size_t>(after - stamps.begin());
}

}  // namespace

Result<Reference> ReadReference(const std::string& groundtruth_path, const std::string& events_path) {
  Reference reference;
  std::string path = events_path;
  if (!groundtruth_path.empty()) {
    HAUSTRA_ASSIGN(reference.poses, ReadGroundTruth(groundtruth_path));
    HAUSTRA_ASSIGN(const std::string text, ReadWholeText(groundtruth_path));
    reference.unit = UnitOf(text);
    if (path.empty()) path = (fs::path(groundtruth_path).parent_path() / "events.csv").string();
  }
  if (path.empty()) return reference;
  if (!events_path.empty() || HasEventColumns(path)) {
    HAUSTRA_ASSIGN(reference.events, ReadSequenceEvents(path));
    const std::string times = (fs::path(path).parent_path() / "times.txt").string();
    std::error_code error;
    if (fs::is_regular_file(times, error)) {
      HAUSTRA_ASSIGN(reference.frame_stamps_ns, ReadFrameTimes(times));
    }
  }
  return reference;
}

std::int64_t FramePeriodNs(const std::vector<RunFrame>& frames) {
  std::vector<std::int64_t> gaps;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const std::int64_t gap = frames[i].timestamp_ns - frames[i - 1].timestamp_ns;
    if (gap > 0) gaps.push_back(gap);
  }
  if (gaps.empty()) return 0;
  std::nth_element(gaps.begin(), gaps.begin() + gaps.size() / 2, gaps.end());
  return gaps[gaps.size() / 2];
}

std::vector<std::optional<SE3>> Associate(const std::vector<RunFrame>& frames,
                                          const std::vector<GroundTruthPose>& poses) {
  std::vector<std::optional<SE3>> result(frames.size());
  if (poses.empty()) return result;
  constexpr std::int64_t kSingleFrameWindowNs = 40000000;
  const std::int64_t period_ns = FramePeriodNs(frames);
  const std::int64_t window_ns = period_ns > 0 ? period_ns / 2 : kSingleFrameWindowNs;
  std::vector<std::int64_t> stamps;
  for (const GroundTruthPose& pose : poses) stamps.push_back(pose.timestamp_ns);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const GroundTruthPose& pose = poses[Nearest(stamps, frames[i].timestamp_ns)];
    if (std::abs(pose.timestamp_ns - frames[i].timestamp_ns) > window_ns) continue;
    const auto& q = pose.world_from_cam_xyzw;
    const auto& p = pose.position_in_world;
    result[i] = SE3(Eigen::Quaterniond(q[3], q[0], q[1], q[2]), Eigen::Vector3d(p[0], p[1], p[2]));
  }
  return result;
}

bool IsClear(const RunFrame& frame, const SequenceOptions& part, const Reference& reference) {
  if (!reference.events) return true;
  const std::vector<std::int64_t>& stamps = reference.frame_stamps_ns;
  const std::int64_t frame_idx = stamps.empty() ? part.StoredFrame(frame.frame_idx)
                                                : static_cast<std::int64_t>(Nearest(stamps, frame.timestamp_ns));
  return std::none_of(reference.events->begin(), reference.events->end(), [&](const SequenceEvent& event) {
    return !event.is_visible && frame_idx >= event.first_frame && frame_idx <= event.last_frame;
  });
}

std::vector<bool> FindClearFrames(const std::vector<RunFrame>& frames, const SequenceOptions& part,
                                  const Reference& reference) {
  std::vector<bool> is_clear;
  is_clear.reserve(frames.size());
  for (const RunFrame& frame : frames) is_clear.push_back(IsClear(frame, part, reference));
  return is_clear;
}

}  // namespace haustra::evaluate
