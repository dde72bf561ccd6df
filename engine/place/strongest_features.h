// The features of a view by strength of response: what votes in retrieval. reentrant; allocates only by growing `out`.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/atlas/frame_features.h"

namespace haustra {

// Indices of the `max_features` strongest, strongest first (ties: lowest index).
void SelectStrongest(const FrameFeatures& features, int max_features, std::vector<std::int32_t>* out);

// The same among the features that show a map point.
void SelectStrongestWithPoint(const Keyframe& keyframe, int max_features, std::vector<std::int32_t>* out);

}  // namespace haustra
