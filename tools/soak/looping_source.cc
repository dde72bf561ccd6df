#include "tools/soak/looping_source.h"

#include <utility>

namespace haustra {

Result<std::unique_ptr<LoopingSource>> LoopingSource::Create(Opener open, bool back_and_forth, Duration video_time) {
  std::unique_ptr<LoopingSource> source(new LoopingSource(std::move(open), back_and_forth, video_time));
  HAUSTRA_ASSIGN(source->mask_source_, source->open_(false));
  source->current_ = source->mask_source_.get();
  const double rate_hz = source->calibration().rate_hz;
  source->period_ = rate_hz > 0 ? Duration(static_cast<std::int64_t>(1e9 / rate_hz)) : std::chrono::milliseconds(40);
  return source;
}

Status LoopingSource::Reopen() {
  if (frames_of_loop_ < 2) return InvalidArgument("the sequence has fewer than two frames that can be read");
  if (back_and_forth_) is_reversed_ = !is_reversed_;
  HAUSTRA_ASSIGN(later_, open_(is_reversed_));
  current_ = later_.get();
  is_fresh_ = true;
  frames_of_loop_ = 0;
  ++num_loops_;
  return Status::Ok();
}

Result<Frame> LoopingSource::Next(TimePoint deadline) {
  if (has_first_ && last_ - first_ + period_ >= video_time_) return NotFound("the time is over");
  while (true) {
    Result<Frame> frame = current_->Next(deadline);
    if (frame.code() == StatusCode::kNotFound) {
      HAUSTRA_TRY(Reopen());
      continue;
    }
    if (frame.code() == StatusCode::kDataLoss) {
      ++next_index_;
      return frame;
    }
    if (!frame.ok()) return frame;
    ++frames_of_loop_;
    if (is_fresh_) {
      is_fresh_ = false;
      // Played back from its end, the sequence begins with the frame that was just shown.
      if (num_loops_ > 0 && back_and_forth_) {
        offset_ = last_ - frame->timestamp;
        continue;
      }
      if (num_loops_ > 0) offset_ = last_ + period_ - frame->timestamp;
    }
    frame->index = next_index_++;
    frame->timestamp += offset_;
    if (!has_first_) first_ = frame->timestamp;
    has_first_ = true;
    last_ = frame->timestamp;
    return frame;
  }
}

}  // namespace haustra
