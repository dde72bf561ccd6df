// OpenCV's SIFT as a yardstick: the same grey picture, masks and number of features as the device's, its contrast
// threshold lowered until it finds as many. Only where OpenCV is installed; never part of the product.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/atlas/frame_features.h"
#include "engine/config.h"
#include "hal/core/status.h"
#include "hal/core/views.h"

namespace haustra::benchmarks {

// Keypoints into `features` (no set, no bearings), their 128 bytes each into `descriptors`. Any format whose first byte
// of a pixel is grey, and BGR. mask: 0 is outside, empty for none. Errors: kInternal, what OpenCV says.
Status ExtractOpenCvSift(const ImageView& image, const ImageView& mask, const FeatureConfig& config,
                         FrameFeatures* features, std::vector<std::uint8_t>* descriptors);

}  // namespace haustra::benchmarks
