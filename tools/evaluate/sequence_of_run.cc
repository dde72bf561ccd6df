#include "tools/evaluate/sequence_of_run.h"

#include <algorithm>
#include <cstdlib>

#include "tools/evaluate/number_text.h"

namespace haustra::evaluate {
namespace {

constexpr std::int64_t kStampToleranceNs = 1000;

// Of the frames as they are stored, 0: not known. From end to end, so that no stamp is off by more than it is rounded.
double StoredRateHz(const RunOutput& run) {
  const auto is_read = [](const RunFrame& frame) { return !frame.is_damaged; };
  const auto first = std::find_if(run.frames.begin(), run.frames.end(), is_read);
  const auto last = std::find_if(run.frames.rbegin(), run.frames.rend(), is_read);
  if (first == run.frames.end() || last->timestamp_ns <= first->timestamp_ns) return 0.0;
  const std::int64_t num_periods = (last->frame_idx - first->frame_idx) * run.figures.part.every_nth;
  return static_cast<double>(num_periods) * 1e9 / static_cast<double>(last->timestamp_ns - first->timestamp_ns);
}

std::string SecondsText(std::int64_t stamp_ns) { return Fixed(static_cast<double>(stamp_ns) * 1e-9, 6) + " s"; }

}  // namespace

SequenceOptions OptionsForPictures(const RunOutput& run) {
  SequenceOptions options = run.figures.part;
  options.calibration = CameraCalibration{};
  options.calibration->rate_hz = StoredRateHz(run);
  return options;
}

Status CheckIsOfRun(const RunOutput& run, std::int64_t frame_idx, TimePoint timestamp, const std::string& sequence) {
  const auto row = std::lower_bound(run.frames.begin(), run.frames.end(), frame_idx,
                                    [](const RunFrame& frame, std::int64_t idx) { return frame.frame_idx < idx; });
  if (row == run.frames.end() || row->frame_idx != frame_idx) return Status::Ok();
  const std::int64_t stamp_ns = timestamp.time_since_epoch().count();
  if (std::abs(row->timestamp_ns - stamp_ns) <= kStampToleranceNs) return Status::Ok();
  return InvalidArgument(sequence + ": frame " + std::to_string(run.figures.part.StoredFrame(frame_idx)) +
                         " has the time " + SecondsText(stamp_ns) + ", the run says " + SecondsText(row->timestamp_ns) +
                         ": not the sequence of this run");
}

}  // namespace haustra::evaluate
