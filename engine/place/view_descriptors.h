// The descriptors of one view on the host. thread-bound(its owner); Read blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

class ViewDescriptors {
 public:
  // The device outlives it. Memory is taken here, for as many features as the device has in a set.
  explicit ViewDescriptors(VisionDevice& device);
  static std::size_t BytesFor(int max_features);

  // Copies the set from the device. kInvalidArgument: one of the features that are asked for cannot be in a set.
  // Errors of the device.
  Status Read(FeatureSetHandle set, std::span<const std::int32_t> features);

  // N x 128 u8, row-major, of the set that was read last.
  std::span<const std::uint8_t> all() const { return descriptors_; }
  const std::uint8_t* row(std::int32_t feature) const {
    return &descriptors_[static_cast<std::size_t>(feature) * kDescriptorBytes];
  }

 private:
  VisionDevice& device_;
  std::vector<std::uint8_t> descriptors_;
};

}  // namespace haustra
