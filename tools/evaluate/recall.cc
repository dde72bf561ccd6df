#include "tools/evaluate/recall.h"

#include <algorithm>
#include <iterator>
#include <map>

namespace haustra::evaluate {
namespace {

bool CanBeCompared(const EvaluatedFrame& frame) { return frame.is_clear && frame.truth && frame.depth > 0.0; }

View ViewOf(const EvaluatedFrame& frame) { return {*frame.truth, frame.depth}; }

std::vector<View> Selected(const std::vector<View>& views) {
  std::vector<View> selected;
  for (const std::size_t i : SelectViews(views)) selected.push_back(views[i]);
  return selected;
}

bool AnyShared(const std::vector<View>& a, const std::vector<View>& b, const SharedView& shared_view) {
  return std::any_of(a.begin(), a.end(), [&](const View& view) {
    return std::any_of(b.begin(), b.end(), [&](const View& other) { return shared_view.Holds(view, other); });
  });
}

// A map as it was begun.
struct BegunMap {
  std::vector<View> views;
  std::map<int, std::size_t> frames_in_final_map;

  int final_map_id() const {
    return std::max_element(frames_in_final_map.begin(), frames_in_final_map.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; })
        ->first;
  }
};

}  // namespace

Recall FindMergeRecall(const std::vector<EvaluatedFrame>& frames, const SharedView& shared_view) {
  std::map<int, BegunMap> maps;
  for (const EvaluatedFrame& frame : frames) {
    if (frame.live_map_id < 0 || !frame.is_localised()) continue;
    BegunMap& map = maps[frame.live_map_id];
    ++map.frames_in_final_map[frame.map_id];
    if (CanBeCompared(frame)) map.views.push_back(ViewOf(frame));
  }
  for (auto& [id, map] : maps) map.views = Selected(map.views);

  Recall recall;
  for (auto first = maps.begin(); first != maps.end(); ++first) {
    for (auto second = std::next(first); second != maps.end(); ++second) {
      if (!AnyShared(first->second.views, second->second.views, shared_view)) continue;
      ++recall.occasions;
      if (first->second.final_map_id() == second->second.final_map_id()) ++recall.taken;
    }
  }
  return recall;
}

Recall FindRelocalisationRecall(const std::vector<EvaluatedFrame>& frames, const std::vector<RunEventRow>& events,
                                const SharedView& shared_view) {
  Recall recall;
  MapGroups groups;
  std::size_t next_event = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (frames[i].live_map_id >= 0 || frames[i - 1].live_map_id < 0) continue;
    for (; next_event < events.size() && events[next_event].frame_idx < frames[i].frame_idx; ++next_event) {
      const RunEventRow& event = events[next_event];
      if (event.event == "merged") groups.Merge(event.map_id, event.other_map_id);
    }
    const std::set<int> lost_map = groups.Of(frames[i - 1].live_map_id);
    std::vector<View> map_views, later_views;
    for (std::size_t j = 0; j < i; ++j) {
      if (lost_map.contains(frames[j].live_map_id) && CanBeCompared(frames[j])) map_views.push_back(ViewOf(frames[j]));
    }
    std::size_t end = i;
    while (end < frames.size() && frames[end].live_map_id < 0) ++end;
    for (std::size_t j = i; j < std::min(end + 1, frames.size()); ++j) {
      if (CanBeCompared(frames[j])) later_views.push_back(ViewOf(frames[j]));
    }
    if (!AnyShared(Selected(later_views), Selected(map_views), shared_view)) continue;
    ++recall.occasions;
    if (end < frames.size() && lost_map.contains(frames[end].live_map_id)) ++recall.taken;
  }
  return recall;
}

}  // namespace haustra::evaluate
