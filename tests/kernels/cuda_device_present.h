// Whether tests of the CUDA device can run here.
#pragma once

#include <string>

#include "kernels/cuda/cuda_vision_device.h"

namespace haustra::testing {

inline const Status& SmallestCudaDeviceStatus() {
  static const Status status = [] {
    LoadCudaKernelsEagerly();
    VisionPlan plan;
    plan.max_width_px = 64;
    plan.max_height_px = 64;
    plan.max_features = 10;
    plan.max_feature_sets = 1;
    plan.max_match_list = 10;
    ExtractOptions options;
    options.num_features = 10;
    return CreateCudaVisionDevice(plan, options).status();
  }();
  return status;
}

// Only the lack of a device counts as such: any other failure is for the tests to find.
inline bool IsCudaDevicePresent() {
  const Status& status = SmallestCudaDeviceStatus();
  return status.message().find("no CUDA device") == std::string::npos;
}
inline std::string NoCudaDeviceReason() { return SmallestCudaDeviceStatus().ToString(); }

}  // namespace haustra::testing
