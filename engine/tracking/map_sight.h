// When tracking last saw its map well. What was established by then is on the wall: debris that came before it since
// may have points too, which agree with each other for as long as it stays (decisions/2026-11-28-what-was-known-before-
// leads.md). Plain data. thread-bound(tracking), rt-safe.
#pragma once

#include "engine/atlas/handles.h"
#include "engine/atlas/reframing.h"
#include "hal/core/time.h"

namespace haustra {

class MapSight {
 public:
  // A frame with fewer points of the map than `thin_points` is thin (KeyframeConfig::low_inliers).
  explicit MapSight(int thin_points) : thin_points_(thin_points) {}

  // A tracked frame showed so many points of the map, of that share of them that the ladder had searched, (0, 1]. One
  // of another map begins anew.
  void Note(MapId map_id, int num_points, double searched_share, TimePoint now);
  void Hear(const Reframing& reframing);

  // The last frame that showed the map well. Of a map that was not the last one tracked: TimePoint::max().
  TimePoint WellSeen(MapId map_id) const { return map_id == map_id_ ? well_seen_ : TimePoint::max(); }

 private:
  int thin_points_;
  MapId map_id_ = kNoId;
  double most_points_ = 0.0;  // that a frame showed, or would have
  TimePoint well_seen_;
};

}  // namespace haustra
