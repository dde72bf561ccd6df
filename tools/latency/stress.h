// Load beside a measurement: threads of ordinary scheduling that never rest, on the processors, the memory and the
// vision device. thread-bound(its owner).
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "hal/vision_device.h"

namespace haustra {

struct StressOptions {
  int cpu_threads = 0;     // arithmetic
  int memory_threads = 0;  // each copies back and forth, far beyond any cache
};

class Stress {
 public:
  // `device` (may be null) is kept busy on its background lane: not the one that is measured. Its plan holds at least
  // two feature sets.
  Stress(const StressOptions& options, std::unique_ptr<VisionDevice> device);
  ~Stress();
  Stress(const Stress&) = delete;
  Stress& operator=(const Stress&) = delete;

 private:
  std::unique_ptr<VisionDevice> device_;
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

}  // namespace haustra
