// Stops a Ceres solver between two iterations, keeping its best state. Private to engine/optim.
#pragma once

#include <ceres/iteration_callback.h>

#include <functional>

#include "engine/optim/should_stop.h"
#include "hal/clock.h"
#include "hal/core/time.h"

namespace haustra::optim {

class StopCallback final : public ceres::IterationCallback {
 public:
  StopCallback(const std::function<bool()>& should_stop, TimePoint deadline, const Clock* clock)
      : should_stop_(should_stop), deadline_(deadline), clock_(clock) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    if (!ShouldStop(should_stop_, deadline_, clock_)) return ceres::SOLVER_CONTINUE;
    has_stopped_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;  // not SOLVER_ABORT, which throws the best state away
  }
  bool has_stopped() const { return has_stopped_; }

 private:
  const std::function<bool()>& should_stop_;
  TimePoint deadline_;
  const Clock* clock_;
  bool has_stopped_ = false;
};

}  // namespace haustra::optim
