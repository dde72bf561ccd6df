// The first request of a kind costs more than the others: a GPU's runtime prepares each kernel, on the heap, and a
// graph is captured for the format of the pictures; a processor maps pages. That is done here, before the first frame
// of a session.
#pragma once

#include "hal/core/status.h"
#include "hal/core/views.h"
#include "hal/frame_source.h"
#include "hal/vision_device.h"

namespace haustra {

// A made-up picture of this size and format, with rows as close as a session hands them over, is extracted twice on the
// tracking lane, the second time with the features of the first to follow. On both lanes it is matched with itself: by
// brute force, with and without an epipolar gate, and guided. The feature sets go again; one is needed at a time.
// Returns the number of features found. Before the device has other work; not rt-safe. Errors of the device.
Result<int> WarmUp(VisionDevice& device, int width_px, int height_px, PixelFormat format);
// For the frames of a source. One that does not know their format, as a file, is taken to be in colour.
Result<int> WarmUp(VisionDevice& device, const FrameSource& source);

}  // namespace haustra
