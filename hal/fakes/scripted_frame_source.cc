#include "hal/fakes/scripted_frame_source.h"

#include <utility>

#include "hal/fakes/frame_tag.h"

namespace haustra {

ScriptedFrameSource::ScriptedFrameSource(const CameraCalibration& calibration, ManualClock* clock)
    : calibration_(calibration),
      clock_(clock),
      pixels_(static_cast<std::size_t>(calibration.width_px) * calibration.height_px, 128) {
  HAUSTRA_CHECK(calibration.width_px >= kFrameTagBytes && calibration.height_px > 0);
}

void ScriptedFrameSource::AddFrame(TimePoint timestamp, std::optional<TimePoint> refused_stamp) {
  entries_.push_back({next_index_++, timestamp, {}, {}, refused_stamp});
}

void ScriptedFrameSource::AddGap(std::uint32_t num_frames) { next_index_ += num_frames; }

void ScriptedFrameSource::AddFailure(StatusCode code, std::string message) {
  HAUSTRA_CHECK(code != StatusCode::kOk);
  entries_.push_back({next_index_++, {}, code, std::move(message)});
}

void ScriptedFrameSource::AddFrames(std::uint32_t num_frames, TimePoint start, Duration period) {
  for (std::uint32_t i = 0; i < num_frames; ++i) AddFrame(start + i * period);
}

ImageView ScriptedFrameSource::static_mask() const {
  if (mask_.empty()) return {};
  return {mask_.data(), calibration_.width_px, calibration_.height_px, calibration_.width_px, PixelFormat::kGrey8};
}

Result<Frame> ScriptedFrameSource::Next(TimePoint deadline) {
  if (position_ == entries_.size()) return NotFound("the script is over");
  const Entry& entry = entries_[position_];
  if (clock_ != nullptr && entry.code == StatusCode::kOk && entry.timestamp > clock_->Now()) {
    if (entry.timestamp > deadline) {
      clock_->AdvanceTo(deadline);
      return Status(StatusCode::kDeadlineExceeded);
    }
    clock_->AdvanceTo(entry.timestamp);
  }
  ++position_;
  if (entry.code != StatusCode::kOk) return Status(entry.code, entry.message);
  WriteFrameTag(entry.index, pixels_);
  return Frame{entry.index, entry.timestamp,
               ImageView{pixels_.data(), calibration_.width_px, calibration_.height_px, calibration_.width_px,
                         PixelFormat::kGrey8},
               false, entry.refused_stamp};
}

}  // namespace haustra
