// Which part of the wall of a map its frames have looked at.
#pragma once

#include <atomic>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/coverage/coverage_options.h"
#include "engine/coverage/wall_coverage.h"
#include "engine/coverage/wall_grid.h"
#include "engine/geometry/se3.h"
#include "hal/core/status.h"
#include "hal/core/views.h"
#include "tools/evaluate/run_output.h"
#include "tools/surface/map_surface.h"
#include "tools/surface/surface_input.h"

namespace haustra::surface {

// A frame that looked at the wall of a map.
struct LookingFrame {
  double time_s = 0.0;
  SE3 cam_from_map;
};

struct MapCoverage {
  std::string no_lumen;          // why no lumen was found, for people; empty: there is one
  std::optional<WallGrid> wall;  // with a lumen; times are those of the frames
  WallCoverage whole;
  std::vector<WallCoverage> segments;
};

// Every frame that has a pose in the map at the end, in order of time, seconds since the first frame of the run.
std::vector<LookingFrame> FramesOf(const evaluate::RunOutput& run, int map_id);

// frames: in order of time. Every frame counts, not only keyframes: these are chosen for what the map needs, and skip
// most of what was looked at. mask: 255 where pictures show the scene; empty: everywhere but where no keyframe has a
// depth, from the edge of the picture on, as in a dark surround. stop: as in SurfaceOptions, looked at once a frame.
// kInvalidArgument: options, camera; kCancelled: stopped.
Result<MapCoverage> MakeMapCoverage(const SurfaceMap& map, const MapSurface& surface,
                                    std::span<const LookingFrame> frames, ImageView mask, const std::atomic<bool>* stop,
                                    const CoverageOptions& options);

}  // namespace haustra::surface
