// Trajectories of one map as text files. Poses are world_from_cam (camera x right, y down, z forward), in map units.
// reentrant.
#pragma once

#include <string>

#include "tools/export/exported_map.h"

namespace haustra::exporting {

// TUM: seconds, position, quaternion x y z w; in time order.
std::string TumText(const ExportedMap& map);
// KITTI: the upper three rows of the matrix of a pose, row by row, a line a frame. Frames without a pose have no line.
std::string KittiText(const ExportedMap& map);
// The seconds of those lines, a line each.
std::string KittiTimesText(const ExportedMap& map);
// With a header, and the number of each frame.
std::string CsvText(const ExportedMap& map);

}  // namespace haustra::exporting
