// Points and camera path of one map as a binary glTF 2.0 file, which viewers and Blender open as it is. glTF's y axis
// points up and the camera's down: the node of the map is turned by half a turn about x. One unit is one map unit. The
// path is a line from each frame to the next; where a frame has no pose it is open. reentrant.
#pragma once

#include <string>

#include "engine/surface/triangle_mesh.h"
#include "tools/export/exported_map.h"

namespace haustra::exporting {

std::string GlbBytes(const ExportedMap& map);

// The surface of one map in the same way.
std::string MeshGlbBytes(const TriangleMesh& mesh, int map_id);

}  // namespace haustra::exporting
