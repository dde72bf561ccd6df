// Depth of one keyframe on a grid that is coarser than its picture: 16-bit inverse range and a confidence a cell.
// Range is the distance from the camera centre along the ray, in map units, so that fisheye cameras have it everywhere.
// Memory is taken at construction. Value type, reentrant; rt-safe but for construction and copies of another size.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "hal/core/memory_arena.h"

namespace haustra {

// Cell (0, 0) covers the first step x step pixels of the picture; its ray is that of their common centre.
inline constexpr double CellCentrePx(int cell, int step_px) { return cell * step_px + 0.5 * (step_px - 1); }

class DepthMap {
 public:
  static constexpr std::uint16_t kNoDepth = 0;
  static constexpr double kMaxCode = 65535.0;

  DepthMap() = default;
  DepthMap(int width, int height, std::pmr::memory_resource* memory = std::pmr::get_default_resource())
      : width_(width),
        height_(height),
        code_(std::size_t(width) * height, memory),
        confidence_(std::size_t(width) * height, memory) {}
  // What one takes from its arena.
  static std::size_t BytesFor(int num_cells) {
    return MemoryArena::BytesFor<std::uint16_t>(num_cells) + MemoryArena::BytesFor<std::uint8_t>(num_cells);
  }

  int width() const { return width_; }
  int height() const { return height_; }
  int num_cells() const { return width_ * height_; }
  // No cell has a depth. Nearer than `near_mu` > 0 nothing can be stored; at a range of r the step between two codes is
  // r / (65535 * near_mu) of it: 0.03 % at twenty times the nearest range.
  void Clear(double near_mu) {
    unit_ = 1.0 / (near_mu * kMaxCode);
    std::fill(code_.begin(), code_.end(), kNoDepth);
    std::fill(confidence_.begin(), confidence_.end(), std::uint8_t{0});
  }

  bool has_depth(int cell) const { return code_[cell] != kNoDepth; }
  // 1 / map units; 0: no depth.
  double inverse_range(int cell) const { return code_[cell] * unit_; }
  // Only where has_depth.
  double range_mu(int cell) const { return 1.0 / inverse_range(cell); }
  // Of all cells; 0: none has a depth.
  double FarthestRange() const {
    double farthest = 0.0;
    for (int i = 0; i < num_cells(); ++i) {
      if (has_depth(i)) farthest = std::max(farthest, range_mu(i));
    }
    return farthest;
  }
  // 0: none; 255: a sharp peak of a nearly perfect match.
  int confidence(int cell) const { return confidence_[cell]; }

  // An inverse range that has no code is stored as no depth.
  void Set(int cell, double inverse_range, int confidence) {
    const double code = std::round(inverse_range / unit_);
    const bool fits = code >= 1.0 && code <= kMaxCode;
    code_[cell] = fits ? static_cast<std::uint16_t>(code) : kNoDepth;
    confidence_[cell] = fits ? static_cast<std::uint8_t>(std::clamp(confidence, 0, 255)) : std::uint8_t{0};
  }
  // The code of another cell in the place of one that is there; confidence stays.
  void Replace(int cell, std::uint16_t code) { code_[cell] = code; }
  // The map's unit has become shorter: all ranges are so many times what they were, > 0.
  void ScaleRanges(double factor) { unit_ /= factor; }

  // As it is stored: inverse range of code 1, 1 / map units, and a code and a confidence a cell.
  double unit() const { return unit_; }
  std::span<const std::uint16_t> codes() const { return code_; }
  std::span<const std::uint8_t> confidences() const { return confidence_; }
  // unit > 0; both of num_cells().
  void Restore(double unit, std::span<const std::uint16_t> codes, std::span<const std::uint8_t> confidences) {
    unit_ = unit;
    std::copy(codes.begin(), codes.end(), code_.begin());
    std::copy(confidences.begin(), confidences.end(), confidence_.begin());
  }
  void Erase(int cell) {
    code_[cell] = kNoDepth;
    confidence_[cell] = 0;
  }

 private:
  int width_ = 0, height_ = 0;
  double unit_ = 1.0;  // inverse range of code 1
  std::pmr::vector<std::uint16_t> code_;
  std::pmr::vector<std::uint8_t> confidence_;
};

}  // namespace haustra
