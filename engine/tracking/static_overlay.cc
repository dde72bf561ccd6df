#include "engine/tracking/static_overlay.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/tracking/reserve_touched.h"

namespace haustra {
namespace {

// Still within so many sigmas of one view; moving beyond so many. What lies between is slow: it says that the place is
// far away, or that the scope rests.
constexpr float kStillSigmas = 1.0f;
constexpr float kMovingSigmas = 4.0f;
// Two neighbours move together when their motions differ by less than this, in sigmas or as a share of the motion: flow
// spreads from the place that the scope goes to, so neighbours differ.
constexpr float kTogetherSigmas = 3.0f;
constexpr float kTogetherShare = 0.3f;
constexpr int kMinCompanions = 3;  // a false match may have one by chance
// Fewer moving features than this around a still one say nothing; then a wider part of the picture is asked.
constexpr int kMinMoving = 6;
constexpr double kMinMovingShare = 0.15;  // of all matches, for the picture as a whole
constexpr int kReaches[] = {1, 2, 12};    // parts; the last is the whole picture
constexpr double kSlowShare = 0.5;        // of the still ones: the far end of the lumen has more slow ones around it
// Seconds. The two views of a founding, a quarter of a second apart or more, are enough to know: a map that takes in
// what stands still is soon held by nothing else. What is uncovered again is so more slowly: a feature that passes
// beside a letter takes it for its own place now and then.
constexpr double kRiseSeconds = 0.3;
constexpr double kFallSeconds = 1.2;
// Twins: scale and angle of one and the same picture element, seen twice through compression.
constexpr float kTwinScale = 1.15f;
constexpr float kTwinAngle = 0.2f;

float AngleBetween(float a, float b) {
  const float difference = std::abs(a - b);
  return std::min(difference, 2.0f * std::numbers::pi_v<float> - difference);
}

}  // namespace

StaticOverlay::StaticOverlay(int width_px, int height_px, int max_features)
    : width_px_(static_cast<float>(width_px)),
      height_px_(static_cast<float>(height_px)),
      grid_(static_cast<std::size_t>(kColumns) * kRows),
      parts_(static_cast<std::size_t>(kPartColumns) * kPartRows) {
  ReserveTouched(&order_, static_cast<std::size_t>(max_features));
  ReserveTouched(&kinds_, static_cast<std::size_t>(max_features));
}

std::size_t StaticOverlay::BytesFor(int max_features) {
  return static_cast<std::size_t>(kColumns) * kRows * sizeof(Cell) +
         static_cast<std::size_t>(kPartColumns) * kPartRows * sizeof(Part) +
         static_cast<std::size_t>(max_features) * (sizeof(std::int32_t) + sizeof(Kind));
}

std::size_t StaticOverlay::CellOf(float x_px, float y_px) const {
  const int column = std::clamp(static_cast<int>(x_px * kColumns / width_px_), 0, kColumns - 1);
  const int row = std::clamp(static_cast<int>(y_px * kRows / height_px_), 0, kRows - 1);
  return static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column);
}

int StaticOverlay::PartOf(const Eigen::Vector2f& px) const {
  const int column = std::clamp(static_cast<int>(px.x() * kPartColumns / width_px_), 0, kPartColumns - 1);
  const int row = std::clamp(static_cast<int>(px.y() * kPartRows / height_px_), 0, kPartRows - 1);
  return row * kPartColumns + column;
}

StaticOverlay::PartRange StaticOverlay::Around(int part, int reach) {
  const int column = part % kPartColumns, row = part / kPartColumns;
  return {std::max(column - reach, 0), std::min(column + reach, kPartColumns - 1), std::max(row - reach, 0),
          std::min(row + reach, kPartRows - 1)};
}

// By the place in the later view, in the order of the matches.
void StaticOverlay::SortIntoParts(std::span<const Motion> motions) {
  std::fill(parts_.begin(), parts_.end(), Part{});
  for (const Motion& motion : motions) ++parts_[static_cast<std::size_t>(PartOf(motion.to_px))].num;
  int sum = 0;
  for (Part& part : parts_) {
    part.first = sum;
    sum += part.num;
    part.num = 0;
  }
  order_.resize(motions.size());
  for (std::size_t i = 0; i < motions.size(); ++i) {
    Part& part = parts_[static_cast<std::size_t>(PartOf(motions[i].to_px))];
    order_[static_cast<std::size_t>(part.first + part.num++)] = static_cast<std::int32_t>(i);
  }
}

bool StaticOverlay::MovesTogether(std::span<const Motion> motions, std::size_t i) const {
  const Eigen::Vector2f motion = motions[i].to_px - motions[i].from_px;
  const float allowed = std::max(kTogetherSigmas * motions[i].sigma_px, kTogetherShare * motion.norm());
  const PartRange around = Around(PartOf(motions[i].to_px), 1);
  int companions = 0;
  for (int row = around.first_row; row <= around.last_row; ++row) {
    for (int column = around.first_column; column <= around.last_column; ++column) {
      const Part& part = parts_[static_cast<std::size_t>(row * kPartColumns + column)];
      for (int k = part.first; k < part.first + part.num; ++k) {
        const auto other = static_cast<std::size_t>(order_[static_cast<std::size_t>(k)]);
        if (other == i || (kinds_[other] != Kind::kMoving && kinds_[other] != Kind::kMovingTogether)) continue;
        if ((motions[other].to_px - motions[other].from_px - motion).squaredNorm() > allowed * allowed) continue;
        if (++companions >= kMinCompanions) return true;
      }
    }
  }
  return false;
}

// Whether what surrounds the part moves, in the narrowest surroundings that say anything.
bool StaticOverlay::IsBeforeMotion(int part) const {
  for (const int reach : kReaches) {
    const PartRange around = Around(part, reach);
    int num_moving = 0, num_slow = 0, num_still = 0;
    for (int row = around.first_row; row <= around.last_row; ++row) {
      for (int column = around.first_column; column <= around.last_column; ++column) {
        const Part& other = parts_[static_cast<std::size_t>(row * kPartColumns + column)];
        num_moving += other.num_moving;
        num_slow += other.num_slow;
        num_still += other.num_still;
      }
    }
    // Where hardly anything but still features is, as within a panel, the slow ones are still ones, badly found.
    if (num_slow < kSlowShare * num_still) num_slow = 0;
    if (num_moving + num_slow >= kMinMoving) return num_moving > num_slow;
  }
  return false;
}

void StaticOverlay::Observe(std::span<const Motion> motions, double seconds, std::span<std::uint8_t> stands_still) {
  std::fill(stands_still.begin(), stands_still.end(), std::uint8_t{0});
  if (stands_still.size() != motions.size()) return;
  motions = motions.first(std::min(motions.size(), kinds_.capacity()));
  SortIntoParts(motions);
  kinds_.resize(motions.size());
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const float sigmas = (motions[i].to_px - motions[i].from_px).norm() / motions[i].sigma_px;
    kinds_[i] = sigmas < kStillSigmas ? Kind::kStill : (sigmas > kMovingSigmas ? Kind::kMoving : Kind::kSlow);
  }
  int num_moving = 0;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    Part& part = parts_[static_cast<std::size_t>(PartOf(motions[i].to_px))];
    if (kinds_[i] == Kind::kMoving && MovesTogether(motions, i)) {
      kinds_[i] = Kind::kMovingTogether;
      ++part.num_moving;
      ++num_moving;
    }
    part.num_slow += kinds_[i] == Kind::kSlow ? 1 : 0;
    part.num_still += kinds_[i] == Kind::kStill ? 1 : 0;
  }
  if (num_moving < kMinMovingShare * static_cast<double>(motions.size())) return;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    if (kinds_[i] != Kind::kStill) continue;
    if (IsBeforeMotion(PartOf(motions[i].to_px))) {
      stands_still[i] = 1;
    } else {
      kinds_[i] = Kind::kSlow;
    }
  }
  Learn(motions, seconds);
}

void StaticOverlay::Mark(float x_px, float y_px, Kind kind, int reach) {
  const std::size_t centre = CellOf(x_px, y_px);
  const int column = static_cast<int>(centre % kColumns), row = static_cast<int>(centre / kColumns);
  for (int r = std::max(row - reach, 0); r <= std::min(row + reach, kRows - 1); ++r) {
    for (int c = std::max(column - reach, 0); c <= std::min(column + reach, kColumns - 1); ++c) {
      Kind& seen = grid_[static_cast<std::size_t>(r) * kColumns + static_cast<std::size_t>(c)].seen;
      if (seen != Kind::kStill) seen = kind;
    }
  }
}

void StaticOverlay::Learn(std::span<const Motion> motions, double seconds) {
  for (std::size_t i = 0; i < motions.size(); ++i) {
    // What stands still is found a little beside itself, too, and goes before what passes beside it.
    if (kinds_[i] == Kind::kStill) Mark(motions[i].to_px.x(), motions[i].to_px.y(), Kind::kStill, 1);
    if (kinds_[i] != Kind::kMovingTogether) continue;
    Mark(motions[i].to_px.x(), motions[i].to_px.y(), Kind::kMovingTogether, 1);
    Mark(motions[i].from_px.x(), motions[i].from_px.y(), Kind::kMovingTogether, 1);
  }
  const double time = std::clamp(seconds, 0.0, kMaxSeconds);
  const auto rise = static_cast<float>(1.0 - std::exp(-time / kRiseSeconds));
  const auto kept = static_cast<float>(std::exp(-time / kFallSeconds));
  num_static_ = 0;
  for (Cell& cell : grid_) {
    if (cell.seen == Kind::kStill) {
      cell.evidence += rise * (1.0f - cell.evidence);
    } else if (cell.seen == Kind::kMovingTogether) {
      cell.evidence *= kept;
    }
    cell.seen = Kind::kSlow;
    num_static_ += cell.evidence >= kStatic ? 1 : 0;
  }
}

void StaticOverlay::FindTwins(std::span<const Keypoint> before, std::span<const Keypoint> now, double sigma_k,
                              double sigma_0_px, std::span<std::int32_t> twins) const {
  std::size_t first = 0;  // of `before` that may be a twin of this feature or a later one
  for (std::size_t i = 0; i < now.size(); ++i) {
    twins[i] = -1;
    const Keypoint& keypoint = now[i];
    const auto radius = kStillSigmas * static_cast<float>(sigma_k * keypoint.scale_px + sigma_0_px);
    // No feature of the octave is found less well than its coarsest.
    const auto widest = kStillSigmas * static_cast<float>(sigma_k * 4.0 * std::exp2(keypoint.octave) + sigma_0_px);
    while (first < before.size() &&
           (before[first].octave < keypoint.octave ||
            (before[first].octave == keypoint.octave && before[first].y_px < keypoint.y_px - widest))) {
      ++first;
    }
    float nearest = radius * radius;
    for (std::size_t k = first; k < before.size() && before[k].octave == keypoint.octave; ++k) {
      const Keypoint& other = before[k];
      const float dx = other.x_px - keypoint.x_px, dy = other.y_px - keypoint.y_px;
      if (dy > radius) break;
      if (dx * dx + dy * dy >= nearest || AngleBetween(other.angle_rad, keypoint.angle_rad) > kTwinAngle ||
          other.scale_px > kTwinScale * keypoint.scale_px || keypoint.scale_px > kTwinScale * other.scale_px) {
        continue;
      }
      nearest = dx * dx + dy * dy;
      twins[i] = static_cast<std::int32_t>(k);
    }
  }
}

}  // namespace haustra
