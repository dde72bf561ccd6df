// The composition root: makes a vision device by its name and checks that camera and configuration fit together.
#pragma once

#include <memory>
#include <string_view>

#include "engine/engine.h"
#include "hal/vision_device.h"

namespace haustra {

// First in main, while the process has one thread: what a device is to do from its start. (A CUDA device loads all its
// kernels when it is made.)
void PrepareVisionDevices();

// "auto" as "cuda" where this build and this machine have it, else as "cpu"; other names as they are.
std::string_view ResolveVisionDevice(std::string_view name);

// "cpu" or "cuda". kUnavailable when this build or this machine does not have it. num_threads: of the CPU device,
// 0 means one for each core.
Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const EngineConfig& config,
                                                         const CameraCalibration& calibration, int num_threads);

// The same for a plan of the caller's own.
Result<std::unique_ptr<VisionDevice>> CreateVisionDevice(std::string_view name, const VisionPlan& plan,
                                                         const ExtractOptions& options, int num_threads);

// Part of the image inside the static mask (0, 1]; 1 without one.
double SceneShare(const ImageView& mask);

}  // namespace haustra
