// Ready-made kinds of sequences: camera, colon, mucosa, path and events that go together. reentrant.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "tools/render/colon.h"
#include "tools/render/event_script.h"
#include "tools/render/lens_drops.h"
#include "tools/render/mucosa_painter.h"
#include "tools/render/scope_path.h"

namespace haustra::render {

struct PresetEvent {
  EventKind kind;
  double at_share;  // of the sequence
  double duration_s;
};

struct Preset {
  std::string_view name;
  std::string_view summary;
  double seconds = 20.0;
  double rate_hz = 25.0;
  int width_px = 720;
  int height_px = 540;
  double blind_end_mm = 130.0;  // from the farthest place of the scope to the dome; nearer than 100: it is seen
  double twin_length_mm = 0.0;
  float noise = 1.0f;
  ColonStyle colon;  // its length and twin follow from the path
  MucosaStyle mucosa;
  PathStyle path;
  LensDropsStyle lens_drops;
  std::vector<PresetEvent> events;
};

const std::vector<Preset>& Presets();
// kInvalidArgument names the preset and lists those that exist.
Result<Preset> FindPreset(std::string_view name);

// A Kannala-Brandt camera of about 110 degrees across, scaled to the size.
CameraCalibration CalibrationFor(int width_px, int height_px, double rate_hz);

}  // namespace haustra::render
