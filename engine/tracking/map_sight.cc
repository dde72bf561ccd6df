#include "engine/tracking/map_sight.h"

#include <algorithm>

namespace haustra {
namespace {

// Well seen: twice what is thin, or half of what the map has ever shown where that is less.
constexpr int kWellFactor = 2;
constexpr double kWellShare = 0.5;

}  // namespace

void MapSight::Note(MapId map_id, int num_points, double searched_share, TimePoint now) {
  const double shown = num_points / searched_share;
  const bool is_other_map = map_id != map_id_;
  if (is_other_map) most_points_ = 0.0;
  map_id_ = map_id;
  most_points_ = std::max(most_points_, shown);
  if (shown < std::min<double>(kWellFactor * thin_points_, kWellShare * most_points_)) return;
  // After a clock was set back points that were established before are still known.
  well_seen_ = is_other_map ? now : std::max(well_seen_, now);
}

void MapSight::Hear(const Reframing& reframing) {
  if (map_id_ == reframing.old_map_id) map_id_ = reframing.new_map_id;
}

}  // namespace haustra
