#include "tools/evaluate/evaluated_frame.h"

#include <algorithm>

namespace haustra::evaluate {

const std::set<int>& MapGroups::Of(int map_id) {
  const auto found =
      std::find_if(groups_.begin(), groups_.end(), [&](const std::set<int>& group) { return group.contains(map_id); });
  if (found != groups_.end()) return *found;
  groups_.push_back({map_id});
  return groups_.back();
}

void MapGroups::Merge(int map_id, int other_map_id) {
  std::set<int> joined = Of(map_id);
  joined.merge(std::set<int>(Of(other_map_id)));
  std::erase_if(groups_, [&](const std::set<int>& group) { return joined.contains(*group.begin()); });
  groups_.push_back(std::move(joined));
}

}  // namespace haustra::evaluate
