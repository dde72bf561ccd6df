// One line on the terminal that says how a run goes: share done, rate, state, map, coverage so far. thread-bound(main).
#pragma once

#include <chrono>
#include <cstdint>

#include "tools/run/run_record.h"

namespace haustra {

class Progress {
 public:
  // num_frames: of the source, 0 when not known. Draws only on a terminal, or every few seconds into a log.
  explicit Progress(std::uint32_t num_frames);

  void Update(const RunRecord& record);
  // Leaves the line.
  void Finish(const RunRecord& record);

 private:
  void Draw(const RunRecord& record);

  std::uint32_t num_frames_;
  bool is_terminal_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_draw_;
};

}  // namespace haustra
