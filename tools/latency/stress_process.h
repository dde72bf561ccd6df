// A second process that keeps the vision device busy beside a measurement, as a compositor or an encoder does. What
// priorities of streams mean between processes is the driver's: without a service that joins them it gives each its
// share of time. thread-bound(its owner).
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "hal/core/status.h"
#include "hal/vision_device.h"

namespace haustra {

class StressProcess {
 public:
  // Starts this program anew with these arguments, which lead to OccupyUntilInputEnds, and waits until that works.
  // kUnavailable: it ends before.
  static Result<std::unique_ptr<StressProcess>> Start(const std::vector<std::string>& arguments);
  // Ends it, and waits for that.
  ~StressProcess();
  StressProcess(const StressProcess&) = delete;
  StressProcess& operator=(const StressProcess&) = delete;

 private:
  StressProcess(pid_t process, int input) : process_(process), input_(input) {}

  pid_t process_;
  int input_;  // its standard input, which holds it
};

// In that process: says that it works, and works until its standard input ends (its parent has gone, too).
void OccupyUntilInputEnds(std::unique_ptr<VisionDevice> device);

}  // namespace haustra
