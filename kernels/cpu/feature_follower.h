// Follows features from the last picture into the current one (kernels/common/flow_parameters.h). Keeps the last
// picture's levels. thread-bound(one lane), Follow is reentrant; nothing but construction allocates.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "hal/vision_device.h"
#include "kernels/common/flow_parameters.h"
#include "kernels/cpu/aligned_buffer.h"
#include "kernels/cpu/sift_kernels.h"

namespace haustra::kernels {

class FeatureFollower {
 public:
  FeatureFollower(const VisionPlan& plan, const SiftKernels& kernels);
  static std::size_t BytesFor(const VisionPlan& plan);
  // Touches all memory.
  void Prefault() { memory_.SetZero(); }

  // Copies the levels of a picture, finest first: at most kFlowLevels, no larger than the plan's octaves from 0 on.
  void Keep(std::span<const Plane> levels);
  void Forget() { num_levels_ = 0; }

  enum class Answer : std::uint8_t {
    kLost,
    kRough,  // where it may be
    kSure,   // well enough for a feature
  };
  // Where the point of the kept picture is in another one with the same levels; input pixels.
  Answer Follow(std::span<const Plane> levels, float x_px, float y_px, float* x_now_px, float* y_now_px) const;

 private:
  const SiftKernels& kernels_;
  AlignedBuffer<float> memory_;
  std::array<Plane, kFlowLevels> levels_;
  std::size_t num_levels_ = 0;
};

}  // namespace haustra::kernels
