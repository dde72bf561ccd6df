// Takes an atlas file (atlas_format.h) back, in two steps: ReadAtlas looks at the file alone and believes nothing of
// it; RestoreAtlas asks whether it fits this program's camera and memory, and only then changes anything.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/atlas/atlas.h"
#include "engine/camera/camera_model.h"
#include "engine/io/saved_atlas.h"
#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

// The whole file in memory, which outlives the result (its descriptors lie there). Every checksum, number and reference
// is verified. kInvalidArgument: not an atlas file; kFailedPrecondition: of another format version; kDataLoss: damaged,
// with section and offset. reentrant; allocates no more than a few times the file's size.
Result<SavedAtlas> ReadAtlas(std::span<const std::uint8_t> file);

// Fills `atlas`, which has never held anything, and uploads the features to `device`. All maps are stored ones, their
// keyframes of earlier sessions. `keyframes` (may be null) receives their handles in order of the ids, for retrieval.
// On error the atlas is as it was and the device holds no set more:
//   kFailedPrecondition: another camera (the message names what differs), other descriptors, the atlas is not empty
//   kCapacityExceeded: a pool is too small; the message names it, what is needed and what there is
//   errors of the device
// thread-bound(mapping), before the first frame.
Status RestoreAtlas(const SavedAtlas& saved, const CameraModel& camera, bool root_sift, VisionDevice& device,
                    Atlas* atlas, std::vector<KeyframeHandle>* keyframes);

}  // namespace haustra
