// The surface of one map: depth of its keyframes, fused into a mesh.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/surface/depth_consistency.h"
#include "engine/surface/depth_map.h"
#include "engine/surface/surface_nets.h"
#include "engine/surface/triangle_mesh.h"
#include "hal/core/status.h"
#include "hal/depth_options.h"
#include "tools/surface/keyframe_pictures.h"
#include "tools/surface/surface_input.h"

namespace haustra::surface {

struct SurfaceOptions {
  DepthOptions depth;
  ConsistencyOptions consistency;
  MeshOptions mesh;
  // Side of a voxel as a share of the median depth: twice the error that depths are to have, so that what remains of it
  // does not make the wall rough.
  double voxel_share = 0.02;
  int max_blocks = 16384;      // 52 MB
  int num_threads = 1;         // the result does not depend on it
  std::string device = "cpu";  // or "cuda": where depth is searched
};

struct KeyframeDepth {
  const SurfaceKeyframe* keyframe = nullptr;
  const KeyframePicture* picture = nullptr;
  DepthMap depth;  // that others agree with
};

struct MapSurface {
  std::vector<KeyframeDepth> depths;  // by keyframe id; those with a depth
  int num_without_picture = 0;        // keyframes that the sequence does not show: of a procedure that was loaded
  int num_without_depth = 0;          // too few points, or no other keyframe that sees them
  double match_ms = 0.0;              // of the depth of a keyframe, median; of one thread
  double voxel_mu = 0.0;
  int num_blocks = 0;
  std::int64_t num_refused_blocks = 0;
  TriangleMesh mesh;
};

// Keeps pointers into `map` and `pictures`. kInvalidArgument: options, camera. kUnavailable: the device.
Result<MapSurface> MakeMapSurface(const SurfaceMap& map, const KeyframePictures& pictures,
                                  const SurfaceOptions& options);

}  // namespace haustra::surface
