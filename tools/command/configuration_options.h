// The options by which commands choose configuration and vision device, in the same words.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "hal/vision_device.h"

namespace haustra {

struct ConfigurationOptions {
  std::string config;                    // file; empty: the defaults
  std::vector<std::string> assignments;  // section.key=value, over the file
  std::string device = "auto";           // cpu, cuda or auto: resolved when it is parsed
  int threads = 0;                       // of the CPU device; 0: NumVisionThreads (platform/assemble.h)
};

// --config, --set, --device and --threads. `options` must outlive the parsing; `device` is "cpu" or "cuda" after it.
void AddConfigurationOptions(CLI::App& command, ConfigurationOptions& options);

// --device alone; the same of `device`.
void AddDeviceOption(CLI::App& command, std::string& device);
// --device and --threads alone.
void AddDeviceOptions(CLI::App& command, std::string& device, int& threads);

// "cpu, 3 threads"; an accelerator by its name alone.
std::string DeviceText(const VisionDevice& device, int num_threads);

}  // namespace haustra
