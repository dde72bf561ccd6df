// New points are on trial: a point that too few keyframes have found again, when a number of keyframes have been added
// to its map, is removed. A trial counts the keyframes of its own map only. It rests while tracking is elsewhere and
// goes on when tracking comes back. thread-bound(mapping); allocates.
#pragma once

#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/config.h"

namespace haustra {

class PointTrial {
 public:
  // `options` outlives it.
  explicit PointTrial(const MappingConfig& options) : options_(options) {}

  // The point was just made.
  void Begin(MapHandle map, MapPointHandle point);
  // A keyframe was added to the map. Returns how many points were removed.
  int CountKeyframe(MapHandle map, Atlas* atlas);
  // The points of `from` belong to `into` now.
  void Join(MapHandle into, MapHandle from);

 private:
  struct Entry {
    MapPointHandle point;  // stale when it has gone by itself
    int num_keyframes = 0;
  };
  // By map slot. A slot that is used again holds stale points at most.
  std::vector<Entry>& Of(MapHandle map);

  const MappingConfig& options_;
  std::vector<std::vector<Entry>> on_trial_;
};

}  // namespace haustra
