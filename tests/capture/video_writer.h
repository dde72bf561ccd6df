// Writes small recordings for tests, through FFmpeg's own encoders.
#pragma once

#include <string>
#include <vector>

#include "capture/image.h"

namespace haustra {

// A pause before a frame; no gap: 0.
struct StampGap {
  int frame = 0;
  int gap_s = 0;  // between the stamps of the frame before and this one
};

// Frames of one size, grey or BGR as the codec takes them; the container follows from the path's ending. codec: "ffv1"
// (lossless grey), "mpeg4" or "mjpeg" (lossy, written as grey YCbCr). Returns an empty string, or what went wrong.
std::string WriteVideo(const std::string& path, const std::string& codec, int rate_hz,
                       const std::vector<Image>& grey_frames, const StampGap& gap = {});

}  // namespace haustra
