// Copies one map out of the atlas as plain data for the writers of engine/io. Mapping thread, or when it has stopped.
#pragma once

#include <functional>

#include "engine/engine.h"
#include "engine/io/map_export.h"

namespace haustra {

// Colour of a pixel of a frame; called once for every point, with its newest observation.
using PointColour = std::function<std::array<std::uint8_t, 3>(std::uint32_t frame_index, const Eigen::Vector2d& pixel)>;

// `image_name` gives the file name of a frame. `colour` may be empty: points are grey then.
MapExport ExportMap(const Engine& engine, MapHandle map, const std::function<std::string(std::uint32_t)>& image_name,
                    const PointColour& colour);

}  // namespace haustra
