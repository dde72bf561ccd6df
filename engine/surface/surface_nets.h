// The wall as triangles: where the signed distance changes sign.
//
// A cell of eight voxels that the wall passes through has one vertex, the mean of where it cuts the cell's edges; an
// edge between voxels of both signs joins the vertices of the four cells around it. Against marching cubes it has no
// tables and no slivers, and half the triangles. Source: Gibson 1998, "Constrained elastic surface nets", without the
// elastic part. reentrant. Allocates what it returns and an index a voxel; not rt-safe.
#pragma once

#include "engine/surface/triangle_mesh.h"
#include "engine/surface/voxel_blocks.h"

namespace haustra {

struct MeshOptions {
  // A voxel that counts less has not been seen well enough, [1, 65535]: two keyframes at a slant, or one squarely.
  int min_weight = 3;
  // Parts that hang together and have fewer triangles are left out: they are errors, not wall.
  int min_part_triangles = 200;
};

// voxel_mu: side of a voxel. Vertices and triangles are in the order of the blocks: same volume, same bits.
TriangleMesh ExtractMesh(const VoxelBlocks& blocks, double voxel_mu, const MeshOptions& options);

}  // namespace haustra
