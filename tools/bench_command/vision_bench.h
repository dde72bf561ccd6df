// Times of the vision device on one picture: extraction and matching, step by step where the device tells.
#pragma once

#include <cstdint>
#include <string>

#include "hal/core/status.h"

namespace haustra {

struct VisionBenchOptions {
  std::string image_path;
  std::string device = "cpu";  // or "cuda"
  int num_threads = 1;         // of the CPU device
  int num_features = 2000;
  int repeats = 1000;             // of each measurement, after a warm-up
  std::int64_t num_database = 0;  // descriptors that 512 queries are matched against; 0: leave out
  bool use_dp4a = false;          // CUDA device
};

// Prints to standard output.
Status RunVisionBench(const VisionBenchOptions& options);

}  // namespace haustra
