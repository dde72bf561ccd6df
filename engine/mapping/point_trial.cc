#include "engine/mapping/point_trial.h"

namespace haustra {

std::vector<PointTrial::Entry>& PointTrial::Of(MapHandle map) {
  if (on_trial_.size() <= map.index) on_trial_.resize(map.index + 1);
  return on_trial_[map.index];
}

void PointTrial::Begin(MapHandle map, MapPointHandle point) { Of(map).push_back({point, 0}); }

int PointTrial::CountKeyframe(MapHandle map, Atlas* atlas) {
  std::vector<Entry>& entries = Of(map);
  int num_removed = 0;
  std::size_t kept = 0;
  for (Entry entry : entries) {
    const MapPoint* point = atlas->GetPoint(entry.point);
    if (point == nullptr) continue;
    if (++entry.num_keyframes < options_.point_trial_keyframes) {
      entries[kept++] = entry;
    } else if (static_cast<int>(point->observations.size()) < options_.min_lasting_observations) {
      atlas->RemovePoint(entry.point);
      ++num_removed;
    }
  }
  entries.resize(kept);
  return num_removed;
}

void PointTrial::Join(MapHandle into, MapHandle from) {
  if (into == from || on_trial_.size() <= from.index) return;
  const std::vector<Entry> moved = std::move(on_trial_[from.index]);
  on_trial_[from.index].clear();
  std::vector<Entry>& entries = Of(into);
  entries.insert(entries.end(), moved.begin(), moved.end());
}

}  // namespace haustra
