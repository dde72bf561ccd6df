// How far a solver came. What may be done with its result follows from this, never from the numbers alone.
#pragma once

#include <cstdint>

namespace haustra {

enum class SolveState : std::uint8_t {
  // Nothing to solve, stopped before the first step that gained something, or failed. The state is the input's.
  kNone,
  // Stopped before it was done, by a deadline, by a request or (pose graph) by its number of iterations.
  kPartial,
  // Done: nothing more is gained, or (bundle) all iterations that were asked for are made. Only now do the residuals
  // tell which observations are wrong.
  kConverged,
};

}  // namespace haustra
