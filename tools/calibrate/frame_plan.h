// Which frames of a clip self-calibration looks at: all of a short one, every few of a longer one, and pieces spread
// over one that is longer still, so that the time it takes is bounded. reentrant.
#pragma once

#include <cstdint>

namespace haustra {

struct FramePlan {
  std::uint32_t stride = 1;  // within a piece
  std::uint32_t piece = 0;   // frames of a piece, 0: the clip is one
  std::uint32_t period = 0;  // from the beginning of a piece to that of the next

  bool IsWanted(std::uint32_t frame_index) const;
  // The number of the piece that a frame is in, or comes after.
  std::uint32_t PieceOf(std::uint32_t frame_index) const { return piece > 0 ? frame_index / period : 0; }
};

// num_frames and rate_hz: 0 when not known.
FramePlan PlanFrames(std::uint32_t num_frames, double rate_hz, int width_px, int height_px);

}  // namespace haustra
