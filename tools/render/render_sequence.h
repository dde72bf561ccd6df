// A whole sequence: the folder that `haustra run` reads, with exact ground truth.
//   frames/%06d.jpg, times.txt (s), calib.yaml, mask.png,
//   calib_true.yaml  the camera that took the pictures; only when calib.yaml was made to differ from it
//   depth/%06d.pgm   true range of every fourth pixel (tools/command/range_picture.h); only when asked for
//   normals/%06d.png true normals of the same (normal_picture.h); only when asked for
//   seen_wall.csv    which part of the wall the frames show (seen_wall.h); only when asked for
//   groundtruth.txt  TUM, world_from_cam, mm; the middle of the exposure
//   events.csv       first_frame,last_frame,kind,visible
//   revisits.csv     frame_a,frame_b,dt_s,distance_mm,axis_angle_deg
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/geometry/se3.h"
#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "tools/render/calibration_error.h"
#include "tools/render/preset.h"
#include "tools/render/shutter.h"

namespace haustra::render {

struct RenderOptions {
  Preset preset;
  std::vector<Event> events;
  double seconds = 20.0;   // [0.2, 3600]
  double rate_hz = 25.0;   // [1, 120]
  int width_px = 720;      // [64, 4096]
  int height_px = 540;     // [64, 4096]
  std::uint64_t seed = 1;  // of the colon and its mucosa, and of the path and all else unless path_seed is given
  std::optional<std::uint64_t> path_seed;
  int num_threads = 1;    // [1, 256]; the pictures do not depend on it
  int jpeg_quality = 92;  // [5, 100]
  Shutter shutter;
  CalibrationError calibration_error;
  bool with_depth = false;      // depth/%06d.pgm, too
  bool with_normals = false;    // normals/%06d.png, too
  bool with_seen_wall = false;  // seen_wall.csv, too
  bool overwrite = false;       // replace a sequence that is already there
  // Once it is set the work ends with kCancelled; looked at once a frame. Null: it is always done.
  const std::atomic<bool>* stop = nullptr;

  // The preset as it is: its length, rate, size and events.
  static RenderOptions FromPreset(const Preset& preset);
  // kInvalidArgument names the option and its range.
  Status Validate() const;
  int num_frames() const;
};

// Events of a preset, placed in a sequence of that length.
std::vector<Event> PlaceEvents(const std::vector<PresetEvent>& events, double seconds);

// Called after each frame with how many are done, from one thread at a time.
using Progress = std::function<void(int done, int total)>;

// kInvalidArgument: options. kFailedPrecondition: the folder holds a sequence and overwrite is off, or holds something
// else. kUnavailable: a file cannot be written. What was written before an error stays (tools/command/output_folder.h).
// kCancelled: stopped; nothing of it stays.
Status RenderSequence(const std::string& folder, const RenderOptions& options, const Progress& progress);

}  // namespace haustra::render
