// The wall of one map of a running engine: its mesh, and which part of it was looked at. reentrant.
#pragma once

#include <cstdint>
#include <string>

#include "hal/core/status.h"
#include "tools/surface/map_surface.h"
#include "tools/view/live_atlas.h"

namespace haustra::view {

struct LiveSurface {
  // For the page, an object in JSON:
  //   map, epoch       of which it is
  //   t_s              when the newest pose was, as in the stream's poses (live_stream.h)
  //   keyframes, depths, triangles
  //   refused_blocks   of the volume: above zero the mesh is cut off
  //   lumen, wall_coverage, seen_poorly, segments   as in surface.json; absent without a lumen, but for its reason
  //   picture          base64 of a PNG: the wall unrolled (coverage_picture.h); absent without a lumen
  //   scope            where along the picture the scope was at that time, share of its width, may lie outside [0, 1];
  //                    absent without a picture, and while the table is older than the pose
  std::string json = "{}";
  std::string ply;  // the mesh; empty when there is none
};

// Of the map that the newest pose lies in, where its keyframes stand; lengths in map units. kNotFound: no keyframe of
// it has a depth yet, or it was caught while it was moved. kInvalidArgument: the camera. kCancelled: stopped.
Result<LiveSurface> MakeLiveSurface(const LiveMaps& maps, const surface::SurfaceOptions& options);

}  // namespace haustra::view
