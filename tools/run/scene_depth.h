// How far away the wall is in the keyframes of a run. A monocular map has no scale but that of what it was made from.
// Where everything in view moves by itself, the scale goes with it: a map of a whole operation may end at a thousandth
// of the scale that it began with, while each of its views is consistent. Depths that run apart say so. reentrant.
#pragma once

#include <optional>
#include <vector>

#include "tools/run/run_summary.h"

namespace haustra {

// Median distance along the optical axis of what a keyframe sees, in map units; nothing: it sees nothing in front of
// it.
std::optional<double> SceneDepthOf(const Keyframe& keyframe, const Atlas& atlas);

// Of each map with such keyframes, by id.
std::vector<SceneDepths> FindSceneDepths(const Atlas& atlas);

}  // namespace haustra
