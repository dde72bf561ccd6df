#include "capture/video_source.h"
#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"

namespace haustra::test {

void FuzzVideo(std::span<const std::uint8_t> bytes) {
  static const MemoryFile calibration(std::string_view(
      "model: kannala_brandt\nwidth_px: 32\nheight_px: 24\nintrinsics: {fx: 20, fy: 20, cx: 16, cy: 12}\n"
      "coefficients: {k1: 0, k2: 0, k3: 0, k4: 0}\n"));
  const MemoryFile file(bytes);
  SequenceOptions options;
  options.calibration_path = calibration.path();
  const Result<std::unique_ptr<FrameSource>> source = OpenVideo(file.path(), options);
  if (!source.ok()) {
    HAUSTRA_CHECK(!source.status().message().empty());
    return;
  }
  TimePoint last = TimePoint::min();
  for (int i = 0; i < 16; ++i) {
    const Result<Frame> frame = (*source)->Next(kNoDeadline);
    if (frame.code() == StatusCode::kDataLoss) continue;
    if (!frame.ok()) break;
    HAUSTRA_CHECK(frame->timestamp > last);
    HAUSTRA_CHECK(frame->image.width == 32 && frame->image.height == 24);
    last = frame->timestamp;
  }
}

}  // namespace haustra::test
