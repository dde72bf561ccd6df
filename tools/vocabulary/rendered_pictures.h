// Pictures of rendered colons for training, each colon with a mucosa, camera and path of its own: what a vocabulary can
// be learnt from where there is no recording.
#pragma once

#include <functional>

#include "hal/camera_calibration.h"
#include "hal/core/status.h"
#include "hal/core/views.h"

namespace haustra {

struct RenderedPicturesOptions {
  int num_colons = 8;           // [1, 1000]; the presets of tools/render take turns, with nothing in the way
  int pictures_per_colon = 25;  // [1, 10000], evenly spaced along the path
  int num_threads = 1;
};

// Called for each colon, then for each of its pictures, in order; an error ends it all and is returned.
struct RenderedPicturesReceiver {
  std::function<Status(const CameraCalibration& calibration, ImageView mask)> begin_colon;
  std::function<Status(ImageView picture)> add_picture;
};

// The colons are never those of `haustra render`: their seeds lie beyond 4 000 000 000. Allocates. The pictures do not
// depend on num_threads. Errors are those of the receiver.
Status RenderPictures(const RenderedPicturesOptions& options, const RenderedPicturesReceiver& receiver);

}  // namespace haustra
