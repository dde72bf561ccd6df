// Where the camera was in each frame, as it is known when the run is over.
//
// The answer to a frame is a pose relative to a keyframe, as the map was at that time. Bundles have moved keyframes and
// points since, also against each other. A frame that became a keyframe has the pose that was adjusted with the map;
// what the adjustment changed of its answer goes over to the frames between two keyframes, in proportion to time.
#pragma once

#include <cstddef>
#include <map>
#include <vector>

#include "engine/engine.h"
#include "tools/run/run_record.h"

namespace haustra {

// Final pose of one frame, or that it has none.
struct FinalPose {
  bool is_localised = false;
  ResolvedPose pose;
  KeyframeId keyframe = kNoId;  // that it was tracked against, or, without an answer, that it is
};

// Final poses of all frames of the record, also of those that became keyframes of a map after their live answer was
// given.
std::vector<FinalPose> ResolveAll(const RunRecord& record, const Engine& engine);

// Gives adjusted frames their poses and carries the frames of their stretches along. A stretch is a row of localised
// frames of one map, without one of `starts` (as many as `poses`) but its first. Before the first and after the last
// adjusted frame of a stretch its correction holds. `adjusted`: cam_from_map by frame, each localised in that map.
void FollowAdjusted(const std::map<std::size_t, SE3>& adjusted, const std::vector<bool>& starts,
                    std::vector<FinalPose>* poses);

}  // namespace haustra
