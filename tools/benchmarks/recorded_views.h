// Frames of a recorded sequence as retrieval sees them: features, and what ground truth says about the camera. For
// benchmarks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/camera/camera_model.h"
#include "engine/config.h"
#include "engine/geometry/se3.h"
#include "hal/core/status.h"
#include "hal/core/time.h"
#include "hal/vision_device.h"

namespace haustra::benchmarks {

struct RecordedView {
  TimePoint timestamp;
  bool is_clear = true;               // the scene can be seen
  std::optional<SE3> world_from_cam;  // true pose
  FrameFeatures features;
};

struct RecordedSequence {
  std::string path;
  CameraModel camera;
  std::vector<RecordedView> views;
  bool has_truth = false;  // groundtruth.txt lies in its folder
};

// Every n-th frame, its features extracted as config.features says, on a device of the sequence's own (size and mask
// are its own), and written to a set of `device`. Name and threads are those of the extractor (platform/assemble.h).
// Errors name the path.
Result<RecordedSequence> ReadViews(const std::string& path, int every_nth, const EngineConfig& config,
                                   const std::string& extractor_name, int num_threads, VisionDevice& device);

}  // namespace haustra::benchmarks
