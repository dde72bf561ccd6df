#include "tools/benchmarks/pair_judge.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "engine/geometry/rotation_fit.h"

namespace haustra::benchmarks {
namespace {

constexpr double kGateOneDof = 1.96;  // 95 %
constexpr int kPartColumns = 12;
constexpr int kPartRows = 9;
// Still: moved by less than this many sigmas, while the middle one moved by more than kMoving of the same.
constexpr double kStillSigmas = 1.0;
constexpr double kMovingSigmas = 4.0;

int OctaveSlot(int octave) { return std::clamp(octave + 1, 0, PairFigures::kOctaves - 1); }

// What is asked of a founding is not asked here: two views a frame apart share a motion, though it has no depth yet.
TwoViewRansac::Options RansacOptions() {
  TwoViewRansac::Options options;
  options.max_iterations = 2000;
  options.confidence = 0.9999;
  options.min_inliers = 8;
  options.max_runner_up_share = 0.999;
  options.min_rival_lead = 0.0;
  options.min_moving_share = 0.0;
  return options;
}

}  // namespace

PairJudge::PairJudge(const EngineConfig& config, int width_px, int height_px, double focal_px)
    : config_(config), width_px_(width_px), height_px_(height_px), focal_px_(focal_px), ransac_(config.features.max) {}

PairFigures PairJudge::Judge(const FrameFeatures& a, const FrameFeatures& b, std::span<const Match> matches) {
  PairFigures figures;
  figures.matches = static_cast<int>(matches.size());
  bearings_a_.clear();
  bearings_b_.clear();
  tolerance_.clear();
  const InitialisationConfig& noise = config_.initialisation;
  for (const Match& match : matches) {
    bearings_a_.push_back(a.bearing(match.query));
    bearings_b_.push_back(b.bearing(match.train));
    const float scale = std::max(a.keypoints[match.query].scale_px, b.keypoints[match.train].scale_px);
    tolerance_.push_back(kGateOneDof * (noise.noise_k * scale + noise.noise_sigma_0_px) / focal_px_);
  }
  Rng rng(1);
  TwoViewRansac::Estimate estimate;
  const bool found = ransac_.Run(bearings_a_, bearings_b_, tolerance_, RansacOptions(), rng, &estimate);
  flags_.assign(matches.size(), 0);
  if (found) std::copy(ransac_.inliers().begin(), ransac_.inliers().end(), flags_.begin());
  of_rotation_.assign(matches.size(), 1);
  residual_.resize(matches.size());
  Eigen::Matrix3d rotation;
  if (FitRotation(bearings_a_, bearings_b_, of_rotation_, &rotation, residual_)) {
    for (std::size_t i = 0; i < matches.size(); ++i) of_rotation_[i] = residual_[i] <= tolerance_[i];
    if (std::count(of_rotation_.begin(), of_rotation_.end(), 1) > std::count(flags_.begin(), flags_.end(), 1)) {
      flags_ = of_rotation_;
    }
  }

  std::set<std::pair<int, int>> places_a, places_b, parts;
  motion_.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (flags_[i] == 0) continue;
    const Eigen::Vector2d from = a.pixel(matches[i].query), to = b.pixel(matches[i].train);
    ++figures.inliers;
    ++figures.inliers_of_octave[OctaveSlot(a.keypoints[matches[i].query].octave)];
    const bool is_new_a = places_a.emplace(std::lround(from.x()), std::lround(from.y())).second;
    const bool is_new_b = places_b.emplace(std::lround(to.x()), std::lround(to.y())).second;
    figures.places += is_new_a && is_new_b ? 1 : 0;
    parts.emplace(static_cast<int>(from.x() * kPartColumns / width_px_),
                  static_cast<int>(from.y() * kPartRows / height_px_));
    motion_.push_back((to - from).norm());
  }
  figures.parts = static_cast<int>(parts.size());
  if (motion_.empty()) return figures;
  std::nth_element(motion_.begin(), motion_.begin() + motion_.size() / 2, motion_.end());
  figures.middle_motion_px = motion_[motion_.size() / 2];
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const double sigma = tolerance_[i] / kGateOneDof * focal_px_;
    const double motion = (b.pixel(matches[i].train) - a.pixel(matches[i].query)).norm();
    figures.still += motion < kStillSigmas * sigma && figures.middle_motion_px > kMovingSigmas * sigma ? 1 : 0;
  }
  return figures;
}

}  // namespace haustra::benchmarks
