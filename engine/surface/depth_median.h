// Takes outliers out of the depth of a keyframe along the edges of its picture. A cell that is farther from the
// weighted median of the depths around it than these are themselves, in the median, gets that median. Cells weigh more
// that are near, as bright as it is, and confident. A window at the edge of a fold finds the fold's range for the wall
// behind it; in the light of a scope that wall is darker than the fold, and as dark as the wall beside it. Source: Ma
// et al. 2013, "Constant time weighted median filtering for stereo matching"; that only outliers are replaced is ours.
// thread-bound(its owner). Memory is taken at construction.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/surface/depth_map.h"
#include "hal/core/views.h"

namespace haustra {

class DepthMedian {
 public:
  // For depth maps of this size, in cells.
  DepthMedian(int width, int height);
  // What one takes on the heap.
  static std::size_t BytesFor(int num_cells);

  // Replaces depths, never by one that no cell around had; confidences and empty cells stay as they are. `grey`:
  // kGrey8, the picture of the depth, at least `step_px` times its size. Same input, same bits. Cost: about 1 us a cell
  // on a core of x86-64. rt-safe.
  void Apply(ImageView grey, int step_px, DepthMap* map);

 private:
  static constexpr int kRadius = 4;  // cells
  static constexpr int kSide = 2 * kRadius + 1;
  static constexpr int kMaxLightSteps = 24;  // farther apart in brightness than this, cells weigh nothing

  void ReadBrightness(ImageView grey, int step_px);
  std::uint16_t Replaced(int x, int y, const DepthMap& map) const;

  int width_ = 0, height_ = 0;
  std::array<std::int32_t, kSide * kSide> near_weights_;        // by rows
  std::array<std::int32_t, kMaxLightSteps + 1> light_weights_;  // by difference of brightness
  // Of each cell.
  std::vector<std::int16_t> brightness_;  // steps of its logarithm
  std::vector<std::uint16_t> codes_;      // before anything is replaced
};

}  // namespace haustra
