// The first request of a kind costs more than the others: a GPU loads its kernels and captures a graph for the format
// of the pictures, a processor maps pages. That is done here, before the first frame of a session.
#pragma once

#include "hal/core/status.h"
#include "hal/core/views.h"
#include "hal/vision_device.h"

namespace haustra {

// A made-up picture of this size and format, with rows as close as a session hands them over, is extracted and matched
// with itself, by brute force and guided, on the tracking lane; and matched on the background lane. The feature set
// goes again. Returns the number of features found. Before the device has other work; not rt-safe. Errors of the
// device.
Result<int> WarmUp(VisionDevice& device, int width_px, int height_px, PixelFormat format);

}  // namespace haustra
