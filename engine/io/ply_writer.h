// The points of one map as binary little-endian PLY: x y z (float), red green blue (uchar), num_observations, map_id
// (int). Opens in MeshLab, CloudCompare, Open3D and Blender. Map units. reentrant, not rt-safe.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/io/map_export.h"
#include "engine/surface/triangle_mesh.h"
#include "hal/core/byte_sink.h"

namespace haustra {

// Of a point, after the header.
inline constexpr std::size_t kPlyPointBytes = 3 * sizeof(float) + 3 + 2 * sizeof(std::int32_t);

// Errors: what the sink returns.
Status WritePly(ByteSink& sink, const MapExport& map);

// The surface of one map: x y z (float), red green blue (uchar), and faces of three vertices (uchar, int). Errors: what
// the sink returns.
Status WriteMeshPly(ByteSink& sink, const TriangleMesh& mesh, int map_id);

}  // namespace haustra
