#include "tools/render/revisits.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace haustra::render {
namespace {

constexpr int kStrideFrames = 5;
constexpr double kLeastGapS = 10.0;
constexpr double kMostDistanceMm = 10.0;
constexpr double kMostAngleDeg = 12.0;

double Degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

}  // namespace

std::vector<Revisit> FindRevisits(const std::vector<SE3>& world_from_cam, double rate_hz,
                                  const std::vector<FrameSpan>& hidden) {
  const int count = static_cast<int>(world_from_cam.size());
  const auto is_hidden = [&](int frame) {
    return std::any_of(hidden.begin(), hidden.end(),
                       [&](const FrameSpan& s) { return frame >= s.first_frame && frame <= s.last_frame; });
  };
  const int least_gap = static_cast<int>(std::min(kLeastGapS * rate_hz, count / 3.0));
  const int stride = std::max(kStrideFrames, static_cast<int>(rate_hz) / kStrideFrames * kStrideFrames);
  std::vector<Revisit> revisits;
  for (int a = 0; a < count; a += stride) {
    if (is_hidden(a)) continue;
    Revisit best;
    double best_score = 2.0;
    for (int b = a + (least_gap + kStrideFrames - 1) / kStrideFrames * kStrideFrames; b < count; b += kStrideFrames) {
      if (is_hidden(b)) continue;
      const SE3 &pose_a = world_from_cam[a], &pose_b = world_from_cam[b];
      const double distance = (pose_a.translation - pose_b.translation).norm();
      const double turn = Degrees(RotationAngle(pose_a.rotation, pose_b.rotation));
      if (distance > kMostDistanceMm || turn > kMostAngleDeg) continue;
      const double score = distance / kMostDistanceMm + turn / kMostAngleDeg;
      if (score >= best_score) continue;
      best_score = score;
      const double cosine =
          (pose_a.rotation * Eigen::Vector3d::UnitZ()).dot(pose_b.rotation * Eigen::Vector3d::UnitZ());
      best = {a, b, (b - a) / rate_hz, distance, Degrees(std::acos(std::clamp(cosine, -1.0, 1.0)))};
    }
    if (best.frame_b > 0) revisits.push_back(best);
  }
  return revisits;
}

}  // namespace haustra::render
