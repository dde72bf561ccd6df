// One line on the terminal that says how a run goes: share done, rate, state, map, frames with a pose so far. Whether
// the map of a pose lasts is not known before the end: the summary counts those that do. thread-bound(main).
#pragma once

#include <cstdint>
#include <string>

#include "tools/command/progress_line.h"
#include "tools/run/run_record.h"

namespace haustra {

class Progress {
 public:
  // num_frames: of the source, 0 when not known.
  explicit Progress(std::uint32_t num_frames);

  void Update(const RunRecord& record);
  // Leaves the line.
  void Finish(const RunRecord& record);

 private:
  std::string Text(const RunRecord& record) const;

  std::uint32_t num_frames_;
  ProgressLine line_;
};

}  // namespace haustra
