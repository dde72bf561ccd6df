// The wall of one map of a running engine: its mesh, and which part of it was looked at. reentrant. Takes a second for
// a hundred keyframes on one core.
#pragma once

#include <cstdint>
#include <string>

#include "hal/core/status.h"
#include "tools/view/live_atlas.h"

namespace haustra::view {

struct LiveSurface {
  // For the page, an object in JSON:
  //   map, epoch       of which it is
  //   keyframes, depths, triangles
  //   lumen, wall_coverage, seen_poorly, segments   as in surface.json; absent without a lumen, but for its reason
  //   picture          base64 of a PNG: the wall unrolled, a pixel a cell, length to the right; absent without a lumen
  //   scope            where along the picture the scope is, share of its width, may lie outside [0, 1]; absent without
  std::string json = "{}";
  std::string ply;  // the mesh; empty when there is none
};

// Of the map that the newest pose lies in. Everything that is the map's own: kNotFound when no keyframe of it has a
// depth yet. kInvalidArgument: the camera.
Result<LiveSurface> MakeLiveSurface(const LiveMaps& maps);

}  // namespace haustra::view
