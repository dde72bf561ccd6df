#include "tools/report/mark_table.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/evaluate/number_text.h"

namespace haustra::report {
namespace {

using evaluate::RunMark;
using evaluate::RunMarkSighting;
using evaluate::RunOutput;
using evaluate::TextTable;

constexpr std::string_view kSeen = "in_front";
constexpr std::array<std::string_view, 4> kStates = {kSeen, "hidden", "unsure", "out_of_view"};  // as the columns

struct MarkHistory {
  std::array<std::size_t, kStates.size()> num_frames{};
  std::optional<std::int64_t> first_seen, last_seen;  // frames
};

std::vector<MarkHistory> HistoriesOf(const RunOutput& run) {
  std::vector<MarkHistory> histories(run.marks.set.size());
  for (const RunMarkSighting& sighting : run.marks.sightings) {
    MarkHistory& history = histories[sighting.mark];
    const auto state = std::find(kStates.begin(), kStates.end(), sighting.state);
    if (state != kStates.end()) ++history.num_frames[static_cast<std::size_t>(state - kStates.begin())];
    if (sighting.state != kSeen) continue;
    history.first_seen = std::min(history.first_seen.value_or(sighting.frame_idx), sighting.frame_idx);
    history.last_seen = std::max(history.last_seen.value_or(sighting.frame_idx), sighting.frame_idx);
  }
  return histories;
}

std::string WhenSet(const RunMark& mark) {
  const std::string frame = "frame " + std::to_string(mark.frame_idx);
  return mark.is_of_this_run ? frame : "session " + std::to_string(mark.session) + ", " + frame;
}

}  // namespace

TextTable MakeMarkTable(const RunOutput& run) {
  std::map<std::int64_t, std::int64_t> stamps_ns;  // by frame
  for (const evaluate::RunFrame& frame : run.frames) stamps_ns[frame.frame_idx] = frame.timestamp_ns;
  const auto moment = [&](std::optional<std::int64_t> frame_idx) -> std::string {
    if (!frame_idx) return evaluate::kNothing;
    const std::string frame = "frame " + std::to_string(*frame_idx);
    const auto stamp = stamps_ns.find(*frame_idx);
    if (stamp == stamps_ns.end()) return frame;
    const double seconds = static_cast<double>(stamp->second - run.frames.front().timestamp_ns) * 1e-9;
    return evaluate::Fixed(seconds, 1) + " s, " + frame;
  };
  TextTable table;
  table.header = {"mark",   "set in",      "map",        "frames in front", "hidden",
                  "unsure", "out of view", "first seen", "last seen"};
  table.num_left = 2;
  const std::vector<MarkHistory> histories = HistoriesOf(run);
  for (std::size_t i = 0; i < histories.size(); ++i) {
    const RunMark& mark = run.marks.set[i];
    std::vector<std::string> row = {mark.label, WhenSet(mark), std::to_string(mark.map_id)};
    for (const std::size_t count : histories[i].num_frames) row.push_back(std::to_string(count));
    row.push_back(moment(histories[i].first_seen));
    row.push_back(moment(histories[i].last_seen));
    table.rows.push_back(std::move(row));
  }
  return table;
}

TextTable MakeRefusedMarkTable(const RunOutput& run) {
  TextTable table;
  table.header = {"refused mark", "why", "frame"};
  table.num_left = 2;
  for (const evaluate::RunRefusedMark& mark : run.marks.refused) {
    table.rows.push_back({mark.label, mark.reason, std::to_string(mark.frame_idx)});
  }
  return table;
}

}  // namespace haustra::report
