// Periodic motion between scope and wall in the final paths of a run. reentrant.
#pragma once

#include <vector>

#include "tools/run/final_poses.h"
#include "tools/run/periodic_motion.h"
#include "tools/run/run_summary.h"

namespace haustra {

// Of each map with frames and keyframes of this run, by id. Times are seconds from the first frame of the record.
// `poses`: one a frame of the record. The scene depth at a time is the median of the points of the keyframes next to
// it.
std::vector<MapMotion> FindMapMotions(const RunRecord& record, const std::vector<FinalPose>& poses,
                                      const Engine& engine);

}  // namespace haustra
