// Copies one map out of the atlas as plain data for the writers of engine/io. Mapping thread, or when it has stopped.
#pragma once

#include <functional>

#include "engine/engine.h"
#include "engine/io/map_export.h"

namespace haustra {

// Colour of a pixel of a frame of this session; called once for every point that one sees, with its newest observation.
using PointColour = std::function<std::array<std::uint8_t, 3>(std::uint32_t frame_index, const Eigen::Vector2d& pixel)>;

// `image_name` gives the file name of a frame of this session. Keyframes that were loaded are named
// session_N/frame_NNNNNN.png by the number of their frame: the atlas does not keep the names of files. `colour` may be
// empty: points are grey then, as are those that only keyframes of earlier sessions see.
MapExport ExportMap(const Engine& engine, MapHandle map, const std::function<std::string(std::uint32_t)>& image_name,
                    const PointColour& colour);

}  // namespace haustra
