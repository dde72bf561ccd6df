#include "tools/report/rejections.h"

#include <algorithm>
#include <map>

#include "tools/evaluate/number_text.h"
#include "tools/evaluate/text_input.h"

namespace haustra::report {
namespace {

using evaluate::Fixed;
using evaluate::kNothing;
using evaluate::RunEventRow;
using evaluate::TextTable;

// In the order of the checks; the words are those of engine/place.
constexpr std::pair<std::string_view, std::string_view> kExplanations[] = {
    {"no_candidate", "nothing in the maps looks alike"},
    {"few_points", "one of the keyframes carries too few map points to prove anything"},
    {"device_failed", "the vision device did not answer"},
    {"few_matches", "the descriptors agree in too few places"},
    {"mapped_once", "most of what the two keyframes show in common is one point already"},
    {"no_similarity", "no similarity (rotation, translation, scale) explains enough of the matches"},
    {"no_pose", "no pose explains enough of the matches"},
    {"low_match_share", "the walls look alike, but most matches contradict the best alignment"},
    {"few_inliers", "guided search around the alignment finds too little more"},
    {"low_inlier_share", "too many of the guided matches disagree with the alignment"},
    {"low_visible_share", "too little is found of what should be in view of both"},
    {"low_spread", "what is found covers too little of the image"},
    {"implausible_scale", "the units of the two maps would differ too much"},
    {"implausible_view", "the two keyframes would look into too different directions"},
    {"uncertain", "what is found does not hold all degrees of freedom of the alignment"},
    {"unconfirmed", "the neighbours of the new keyframe do not see the same"},
    {"implausible_drift", "inside one map: no drift could be as large as this correction"},
    {"ambiguous", "another place agrees as well"},
    {"outdated", "tracking had left that map, or the keyframe had gone, before the maps could be joined"},
    {"not_joined", "the loop could not be closed in the time there was; the map stayed as it was"},
};

// Counts that the engine writes, in the order of the checks.
constexpr std::pair<const char*, const char*> kCounts[] = {
    {"votes", "votes"},       {"matches", "matches"},    {"ransac_inliers", "RANSAC inliers"},
    {"agreeing", "agreeing"}, {"guided", "guided"},      {"inliers", "inliers"},
    {"visible", "visible"},   {"confirming", "confirm."}};

std::string DetailText(const RunEventRow& event, std::string_view name) {
  const std::optional<std::int64_t> value = DetailOf(event, name);
  return value ? std::to_string(*value) : kNothing;
}

std::string KeyframeText(const RunEventRow& event, bool is_relocalisation) {
  return DetailText(event, is_relocalisation ? "keyframe" : "other_keyframe");
}

}  // namespace

std::vector<Rejection> FindRejections(const std::vector<RunEventRow>& events) {
  std::vector<Rejection> rejections;
  for (const RunEventRow& event : events) {
    const bool is_merge = event.event == "merge_rejected";
    if (!is_merge && event.event != "frame_not_found") continue;
    Rejection rejection;
    rejection.frame_idx = event.frame_idx;
    rejection.what = !is_merge ? "relocalisation" : event.map_id == event.other_map_id ? "loop" : "merge";
    const std::vector<std::string_view> words = evaluate::SplitBlanks(event.details);
    rejection.reason = words.empty() ? std::string("not stated") : std::string(words[0]);
    rejection.event = event;
    rejections.push_back(std::move(rejection));
  }
  return rejections;
}

std::string_view Explanation(std::string_view reason) {
  for (const auto& [word, explanation] : kExplanations) {
    if (word == reason) return explanation;
  }
  return {};
}

TextTable MakeReasonTable(const std::vector<Rejection>& rejections) {
  std::map<std::string, std::map<std::string, std::size_t>> counts;  // by reason, by what
  std::map<std::string, std::size_t> totals;
  for (const Rejection& rejection : rejections) {
    ++counts[rejection.reason][rejection.what];
    ++totals[rejection.reason];
  }
  std::vector<std::string> order;
  for (const auto& [reason, count] : totals) order.push_back(reason);
  std::stable_sort(order.begin(), order.end(),
                   [&](const std::string& a, const std::string& b) { return totals[a] > totals[b]; });
  TextTable table;
  table.title = "Rejected candidates by reason";
  table.num_left = 2;
  table.header = {"reason", "what it means", "merges", "loops", "relocalisations", "all"};
  for (const std::string& reason : order) {
    table.rows.push_back({reason, std::string(Explanation(reason)), std::to_string(counts[reason]["merge"]),
                          std::to_string(counts[reason]["loop"]), std::to_string(counts[reason]["relocalisation"]),
                          std::to_string(totals[reason])});
  }
  return table;
}

TextTable MakeRejectionTable(const std::vector<Rejection>& rejections, const std::vector<evaluate::RunFrame>& frames,
                             std::size_t max_rows) {
  std::map<std::int64_t, double> time_s;
  for (const evaluate::RunFrame& frame : frames) {
    time_s[frame.frame_idx] = static_cast<double>(frame.timestamp_ns - frames[0].timestamp_ns) * 1e-9;
  }
  TextTable table;
  table.title = "Rejected candidates";
  table.num_left = 2;
  table.header = {"what", "reason", "frame", "time s", "map", "other map", "other keyframe", "its frame"};
  for (const auto& [name, title] : kCounts) table.header.push_back(title);
  for (std::size_t i = 0; i < std::min(rejections.size(), max_rows); ++i) {
    const Rejection& rejection = rejections[i];
    const RunEventRow& event = rejection.event;
    const auto time = time_s.find(rejection.frame_idx);
    const bool is_relocalisation = rejection.what == "relocalisation";
    std::vector<std::string> row{rejection.what,
                                 rejection.reason,
                                 std::to_string(rejection.frame_idx),
                                 time == time_s.end() ? kNothing : Fixed(time->second, 2),
                                 event.map_id < 0 ? kNothing : std::to_string(event.map_id),
                                 event.other_map_id < 0 ? kNothing : std::to_string(event.other_map_id),
                                 KeyframeText(event, is_relocalisation),
                                 DetailText(event, "other_frame")};
    for (const auto& [name, title] : kCounts) row.push_back(DetailText(event, name));
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace haustra::report
