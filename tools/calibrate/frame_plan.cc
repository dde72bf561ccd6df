#include "tools/calibrate/frame_plan.h"

#include <algorithm>
#include <cmath>

namespace haustra {
namespace {

// Frames of 720x540 that are looked at; of smaller ones more, in about the same time.
constexpr double kBudget = 500.0;
constexpr double kBudgetPixels = 720.0 * 540.0;
constexpr double kMinBudget = 250.0, kMaxBudget = 1500.0;
// Looked at less often, features are lost between frames.
constexpr double kMinRateHz = 6.0;
constexpr double kPieceRateHz = 12.5;
constexpr double kUsualRateHz = 25.0;
constexpr std::uint32_t kLookedAtInPiece = 50;

}  // namespace

bool FramePlan::IsWanted(std::uint32_t frame_index) const {
  const std::uint32_t in_piece = piece > 0 ? frame_index % period : frame_index;
  return (piece == 0 || in_piece < piece) && in_piece % stride == 0;
}

FramePlan PlanFrames(std::uint32_t num_frames, double rate_hz, int width_px, int height_px) {
  const double rate = rate_hz > 0.0 ? rate_hz : kUsualRateHz;
  const double pixels = std::max(1.0, static_cast<double>(width_px) * height_px);
  const double budget = std::clamp(kBudget * kBudgetPixels / pixels, kMinBudget, kMaxBudget);
  FramePlan plan;
  plan.stride = std::max(1u, static_cast<std::uint32_t>(std::ceil(num_frames / budget)));
  const auto longest = std::max(1u, static_cast<std::uint32_t>(rate / kMinRateHz));
  if (num_frames > 0 && plan.stride <= longest) return plan;
  plan.stride = std::max(1u, static_cast<std::uint32_t>(std::lround(rate / kPieceRateHz)));
  if (num_frames == 0) return plan;
  plan.piece = kLookedAtInPiece * plan.stride;
  const auto num_pieces = static_cast<std::uint32_t>(budget / kLookedAtInPiece);
  plan.period = std::max(plan.piece, num_frames / std::max(1u, num_pieces));
  return plan;
}

}  // namespace haustra
