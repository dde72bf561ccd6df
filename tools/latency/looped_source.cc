#include "tools/latency/looped_source.h"

#include <algorithm>
#include <string>

namespace haustra {
namespace {

constexpr double kUsualRateHz = 25.0;

std::vector<std::uint8_t> CopyOf(const ImageView& image, ImageView* view) {
  const std::ptrdiff_t row_bytes = static_cast<std::ptrdiff_t>(image.width) * BytesPerPixel(image.format);
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(row_bytes) * image.height);
  for (int y = 0; y < image.height; ++y) std::copy_n(image.row(y), row_bytes, pixels.data() + y * row_bytes);
  *view = {pixels.data(), image.width, image.height, row_bytes, image.format};
  return pixels;
}

}  // namespace

Result<std::unique_ptr<LoopedSource>> LoopedSource::Load(FrameSource& source, int max_frames) {
  std::unique_ptr<LoopedSource> loop(new LoopedSource());
  loop->calibration_ = source.calibration();
  const double rate_hz = loop->calibration_.rate_hz > 0 ? loop->calibration_.rate_hz : kUsualRateHz;
  loop->period_ = Duration(static_cast<std::int64_t>(1e9 / rate_hz));
  if (!source.static_mask().is_empty()) loop->mask_.pixels = CopyOf(source.static_mask(), &loop->mask_.view);
  while (static_cast<int>(loop->frames_.size()) < max_frames) {
    const Result<Frame> frame = source.Next(kNoDeadline);
    if (frame.code() == StatusCode::kNotFound) break;
    if (frame.code() == StatusCode::kDataLoss) continue;
    if (!frame.ok()) return frame.status();
    // The vector's memory, and with it the view, stays where it is when the picture moves.
    Picture picture;
    picture.pixels = CopyOf(frame->image, &picture.view);
    loop->num_bytes_ += picture.pixels.size();
    loop->frames_.push_back(std::move(picture));
  }
  if (loop->frames_.size() < 2) {
    return FailedPrecondition("the sequence has " + std::to_string(loop->frames_.size()) +
                              " readable frames; two are needed to go there and back");
  }
  return loop;
}

ImageView LoopedSource::static_mask() const { return mask_.pixels.empty() ? ImageView{} : mask_.view; }

Result<Frame> LoopedSource::Next(TimePoint) {
  const std::size_t period = 2 * frames_.size() - 2;
  const std::size_t phase = next_ % period;
  Frame frame;
  frame.index = next_;
  frame.timestamp = TimePoint(next_ * period_);
  frame.image = frames_[phase < frames_.size() ? phase : period - phase].view;
  ++next_;
  return frame;
}

}  // namespace haustra
