// Saves an atlas as a file (atlas_format.h) that ReadAtlas takes back: saved, loaded and saved again it is the same to
// the byte. thread-bound(mapping), or any when the mapping thread has stopped; not rt-safe. Allocates one keyframe's
// features at a time and the points (some 400 bytes each); about 0.3 MB of file for a keyframe of 2000 features.
#pragma once

#include "engine/atlas/atlas.h"
#include "hal/camera_calibration.h"
#include "hal/core/byte_sink.h"
#include "hal/vision_device.h"

namespace haustra {

// root_sift: kind of the descriptors (FeatureConfig). They are read back from `device`. kInternal: the atlas is not
// one that could be read again (nothing was written then); otherwise the errors of device and sink.
Status WriteAtlas(const Atlas& atlas, const CameraCalibration& camera, bool root_sift, VisionDevice& device,
                  ByteSink& sink);

}  // namespace haustra
