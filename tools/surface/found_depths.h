// Depths of the keyframes of a map, before they are held against each other: searched in the sequence of the run, or
// kept by the run itself.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "capture/image.h"
#include "engine/surface/depth_map.h"
#include "hal/core/status.h"
#include "hal/depth_options.h"
#include "tools/surface/keyframe_pictures.h"
#include "tools/surface/surface_input.h"

namespace haustra::surface {

struct FoundDepth {
  const SurfaceKeyframe* keyframe = nullptr;
  std::int64_t frame_idx = 0;     // of the run
  std::int64_t stored_frame = 0;  // of the sequence
  DepthMap raw;
  Image colour;  // of the camera's size, or a pixel a cell; kBgr8 or kGrey8
};

struct FoundDepths {
  std::vector<FoundDepth> depths;  // by keyframe id
  int step_px = 0;                 // of all of them
  int num_without_picture = 0;     // keyframes that the sequence does not show: of a procedure that was loaded
  int num_without_depth = 0;       // too few points, or no other keyframe that sees them
  double match_ms = 0.0;           // of the depth of a keyframe, median; of one thread; 0: not measured
};

// Keeps pointers into `map`. device: "cpu" or "cuda", where depth is searched. The result does not depend on
// num_threads. kInvalidArgument: options, camera. kUnavailable: the device.
Result<FoundDepths> SearchDepths(const SurfaceMap& map, const KeyframePictures& pictures, const DepthOptions& options,
                                 const std::string& device, int num_threads);

// What `haustra run` with depth.enabled has written beside the map.
// kNotFound: the run kept no depth. kDataLoss and others of ReadDepthFile, with the file's name. kInvalidArgument: not
// of this camera.
Result<FoundDepths> ReadKeptDepths(const evaluate::RunOutput& run, const SurfaceMap& map);

// Whether the run kept the depth of any of these maps.
bool HasKeptDepths(const evaluate::RunOutput& run, const std::vector<SurfaceMap>& maps);

}  // namespace haustra::surface
