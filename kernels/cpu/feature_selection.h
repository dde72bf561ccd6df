// Chooses which points become features when there are more than wanted: strong ones, spread over the image.
//
// The image is divided into squares. A point's priority is its response (of the finest octave
// kFinestOctavePriority of it), halved for every so many stronger points of
// its own square: where a square is crowded, its weaker points give way to the stronger points of poorer ones, and no
// square is filled with noise only because it is empty.
#pragma once

#include <cstdint>
#include <span>

#include "kernels/cpu/aligned_buffer.h"
#include "kernels/cpu/sift_refinement.h"

namespace haustra::kernels {

// thread-bound(one at a time); Select does not allocate.
class FeatureSelection {
 public:
  FeatureSelection(int max_width_px, int max_height_px, int max_points);
  static std::size_t BytesFor(int max_width_px, int max_height_px, int max_points);
  // Touches all memory.
  void Prefault();

  // Indices of the `wanted` points of highest priority (fewer when there are fewer), highest first; ties: lowest index.
  // At most max_points points. Valid until the next call.
  std::span<const std::int32_t> Select(std::span<const ScaleSpacePoint> points, int width_px, int height_px,
                                       int wanted);

 private:
  struct Ranked {
    float priority;
    std::int32_t index;
  };

  AlignedBuffer<Ranked> ranked_;
  AlignedBuffer<std::int32_t> cell_starts_;
  AlignedBuffer<std::int32_t> order_;
};

}  // namespace haustra::kernels
