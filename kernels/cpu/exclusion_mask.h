// Where no feature may lie: reflections, the dark surround of the scope's window and what a static mask leaves out; one
// mask for each octave, dilated more the coarser the octave.
//
// Masks hold 255 where pixels are excluded. Mask pixel (x, y) of octave o >= 0 stands for the 2^o x 2^o input pixels
// from (x, y) * 2^o on. Level 0 serves the octave at twice the input's size as well, with half the dilation.
// thread-bound(one at a time); Build does not allocate.
#pragma once

#include <cstdint>
#include <vector>

#include "hal/core/views.h"
#include "kernels/common/sift_parameters.h"
#include "kernels/cpu/aligned_buffer.h"

namespace haustra::kernels {

struct MaskOptions {
  int reflection_threshold = 245;  // at or above: reflection; 256: none
  int border_threshold = 12;  // below, and seen from the edge of the image along a row or column: surround; 0: none
  int dilation_px = 4;        // at octave 0, doubled at each coarser octave; squares, not discs
};

class ExclusionMask {
 public:
  ExclusionMask(int max_width_px, int max_height_px, const MaskOptions& options);
  static std::size_t BytesFor(int max_width_px, int max_height_px, const MaskOptions& options);
  // Touches all memory.
  void Prefault();

  // grey: width x height bytes with the given pitch; static_mask: same size, 0 is outside; empty: none.
  void Build(const std::uint8_t* grey, int width_px, int height_px, int pitch_bytes, ImageView static_mask);

  // Whether a point of an octave is excluded; x, y in octave pixels, inside the octave.
  bool IsExcluded(int octave, float x, float y) const {
    if (octave < 0) {
      x *= 0.5f;
      y *= 0.5f;
      octave = kHalfDilation;
    }
    const Level& level = levels_[octave];
    const int column = static_cast<int>(x);
    const int row = static_cast<int>(y);
    return level.dilated[static_cast<std::size_t>(row) * level.width_px + column] != 0;
  }

  // The undilated mask of an octave (-1: that of the input), for those who weigh pixels: 255 is excluded.
  const std::uint8_t* undilated(int octave) const { return levels_[octave < 0 ? 0 : octave].raw.data(); }
  int width_px(int octave) const { return levels_[octave < 0 ? 0 : octave].width_px; }
  int height_px(int octave) const { return levels_[octave < 0 ? 0 : octave].height_px; }

 private:
  static constexpr int kHalfDilation = kMaxOctaves;  // slot of the mask of the finest octave

  struct Level {
    int width_px = 0;
    int height_px = 0;
    AlignedBuffer<std::uint8_t> raw;
    AlignedBuffer<std::uint8_t> dilated;
  };

  void MarkReflections(const std::uint8_t* grey, int pitch_bytes);
  void MarkSurround(const std::uint8_t* grey, int pitch_bytes);
  void Dilate(const Level& from, int radius_px, Level& to);

  MaskOptions options_;
  std::vector<Level> levels_;  // octaves 0 .. kMaxOctaves - 1, then the finest
  AlignedBuffer<std::uint8_t> scratch_;
  AlignedBuffer<std::uint8_t> columns_alive_;
};

}  // namespace haustra::kernels
