#include "kernels/cpu/feature_follower.h"

#include <algorithm>
#include <cmath>

#include "kernels/common/gaussian_kernel.h"

namespace haustra::kernels {
namespace {

int StrideOf(int width) { return AlignUp(width, kStrideAlignment) + kStrideAlignment; }

std::size_t NumFloats(const VisionPlan& plan) {
  std::size_t sum = 0;
  for (int octave = 0; octave < kFlowLevels; ++octave) {
    sum += static_cast<std::size_t>(StrideOf(OctaveSize(plan.max_width_px, octave))) *
               OctaveSize(plan.max_height_px, octave) +
           kPlanePadding;
  }
  return sum;
}

// From coarse to fine; a level that says nothing leaves what the coarser ones have said. The correlation of the finest.
float FollowThrough(const SiftKernels& kernels, std::span<const Plane> from, std::span<const Plane> to, float x,
                    float y, float* x_there, float* y_there) {
  float moved_x = 0.0f, moved_y = 0.0f, correlation = -1.0f;
  for (std::size_t level = std::min(from.size(), to.size()); level-- > 0;) {
    const float to_level = std::ldexp(1.0f, -static_cast<int>(level));
    float level_x = (x + moved_x) * to_level, level_y = (y + moved_y) * to_level;
    correlation = kernels.AlignPatch(from[level], to[level], x * to_level, y * to_level, &level_x, &level_y);
    if (correlation < 0.0f) continue;
    moved_x = level_x / to_level - x;
    moved_y = level_y / to_level - y;
  }
  *x_there = x + moved_x;
  *y_there = y + moved_y;
  return correlation;
}

}  // namespace

FeatureFollower::FeatureFollower(const VisionPlan& plan, const SiftKernels& kernels)
    : kernels_(kernels), memory_(NumFloats(plan)) {}

std::size_t FeatureFollower::BytesFor(const VisionPlan& plan) {
  return AlignedBuffer<float>::BytesFor(NumFloats(plan));
}

void FeatureFollower::Keep(std::span<const Plane> levels) {
  num_levels_ = std::min(levels.size(), levels_.size());
  float* to = memory_.data();
  for (std::size_t i = 0; i < num_levels_; ++i) {
    const std::size_t size = static_cast<std::size_t>(levels[i].stride) * levels[i].height;
    std::copy_n(levels[i].data, size, to);
    levels_[i] = levels[i];
    levels_[i].data = to;
    to += size + kPlanePadding;
  }
}

FeatureFollower::Answer FeatureFollower::Follow(std::span<const Plane> levels, float x_px, float y_px, float* x_now_px,
                                                float* y_now_px) const {
  const std::span<const Plane> kept(levels_.data(), num_levels_);
  const float there = FollowThrough(kernels_, kept, levels, x_px, y_px, x_now_px, y_now_px);
  if (there < kFlowMinRoughCorrelation) return Answer::kLost;
  float back_x = 0.0f, back_y = 0.0f;
  const float back = FollowThrough(kernels_, levels, kept, *x_now_px, *y_now_px, &back_x, &back_y);
  const float correlation = std::min(there, back), distance = std::hypot(back_x - x_px, back_y - y_px);
  if (correlation >= kFlowMinCorrelation && distance <= kFlowMaxReturnPx) return Answer::kSure;
  return correlation >= kFlowMinRoughCorrelation && distance <= kFlowMaxRoughReturnPx ? Answer::kRough : Answer::kLost;
}

}  // namespace haustra::kernels
