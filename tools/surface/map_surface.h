// The surface of one map: depths of its keyframes, held against each other and fused into a mesh.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/surface/depth_consistency.h"
#include "engine/surface/depth_map.h"
#include "engine/surface/surface_nets.h"
#include "engine/surface/triangle_mesh.h"
#include "hal/core/status.h"
#include "tools/surface/found_depths.h"
#include "tools/surface/surface_input.h"

namespace haustra::surface {

struct SurfaceOptions {
  ConsistencyOptions consistency;
  MeshOptions mesh;
  // Side of a voxel as a share of the median depth: twice the error that depths are to have, so that what remains of it
  // does not make the wall rough.
  double voxel_share = 0.02;
  int max_blocks = 16384;  // 68 MB
  int num_threads = 1;     // the result does not depend on it
  // Once it is set the work ends with kCancelled; looked at once a keyframe. Null: it is always done.
  const std::atomic<bool>* stop = nullptr;
};

inline bool IsStopped(const std::atomic<bool>* stop) { return stop != nullptr && stop->load(); }

struct KeyframeDepth {
  const SurfaceKeyframe* keyframe = nullptr;
  std::int64_t frame_idx = 0;     // of the run
  std::int64_t stored_frame = 0;  // of the sequence
  DepthMap depth;                 // that others agree with
};

struct MapSurface {
  std::vector<KeyframeDepth> depths;  // by keyframe id; those with a depth
  int step_px = 0;                    // from cell to cell of them
  // As in FoundDepths.
  int num_without_picture = 0;
  int num_without_depth = 0;
  double match_ms = 0.0;
  double voxel_mu = 0.0;
  int num_blocks = 0;
  std::int64_t num_refused_blocks = 0;
  TriangleMesh mesh;
};

// Keeps pointers into `map`. kInvalidArgument: camera; kCancelled: stopped.
Result<MapSurface> MakeMapSurface(const SurfaceMap& map, const FoundDepths& found, const SurfaceOptions& options);

}  // namespace haustra::surface
