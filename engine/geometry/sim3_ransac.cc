#include "engine/geometry/sim3_ransac.h"

#include <algorithm>
#include <array>
#include <limits>

#include "engine/geometry/ransac_trials.h"

namespace haustra {
namespace {

constexpr int kSampleSize = 3;
constexpr int kMinMatches = 4;
constexpr int kLocalIterations = 3;

}  // namespace

Sim3Ransac::Sim3Ransac(int max_matches)
    : max_matches_(max_matches), inliers_(max_matches), points_in_a_(max_matches), points_in_b_(max_matches) {}

double Sim3Ransac::MatchCost(const Input& input, const Sim3& b_from_a, const Sim3& a_from_b, int index) const {
  const Sim3Match& match = input.matches[index];
  Eigen::Vector2d pixel;
  if (!input.camera->Project(input.views_b[match.view_b] * (b_from_a * match.point_in_a), &pixel)) return 1.0;
  const double chi2_b = (pixel - match.pixel_in_b).squaredNorm() / (match.sigma_b_px * match.sigma_b_px);
  if (chi2_b * input.inverse_gate >= 1.0) return 1.0;
  if (!input.camera->Project(input.views_a[match.view_a] * (a_from_b * match.point_in_b), &pixel)) return 1.0;
  const double chi2_a = (pixel - match.pixel_in_a).squaredNorm() / (match.sigma_a_px * match.sigma_a_px);
  return std::min(1.0, std::max(chi2_a, chi2_b) * input.inverse_gate);
}

double Sim3Ransac::Cost(const Input& input, const Sim3& b_from_a, double bound) const {
  const Sim3 a_from_b = b_from_a.Inverse();
  double cost = 0.0;
  for (int i = 0; i < num_matches_ && cost < bound; ++i) cost += MatchCost(input, b_from_a, a_from_b, i);
  return cost;
}

bool Sim3Ransac::AlignInliers(const Input& input, Sim3* b_from_a) {
  const Sim3 a_from_b = b_from_a->Inverse();
  std::size_t count = 0;
  for (int i = 0; i < num_matches_; ++i) {
    if (MatchCost(input, *b_from_a, a_from_b, i) >= 1.0) continue;
    points_in_a_[count] = input.matches[i].point_in_a;
    points_in_b_[count] = input.matches[i].point_in_b;
    ++count;
  }
  return AlignSim3({points_in_a_.data(), count}, {points_in_b_.data(), count}, b_from_a);
}

bool Sim3Ransac::Run(const CameraModel& camera, std::span<const Sim3Match> matches, std::span<const SE3> views_a,
                     std::span<const SE3> views_b, const Options& options, Rng& rng, Estimate* estimate) {
  num_matches_ = 0;
  const int min_inliers = std::max(options.min_inliers, kMinMatches);
  if (matches.size() > static_cast<std::size_t>(max_matches_)) return false;
  num_matches_ = static_cast<int>(matches.size());
  std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
  if (num_matches_ < min_inliers) return false;
  for (const Sim3Match& match : matches) {
    if (match.view_a < 0 || match.view_a >= static_cast<int>(views_a.size())) return false;
    if (match.view_b < 0 || match.view_b >= static_cast<int>(views_b.size())) return false;
  }
  const Input input{&camera, matches, views_a, views_b, 1.0 / options.chi2_gate};

  Sim3 best;
  double best_cost = std::numeric_limits<double>::infinity();
  int needed = options.max_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    std::array<int, kSampleSize> sample;
    rng.SampleDistinct(num_matches_, sample);
    std::array<Eigen::Vector3d, kSampleSize> in_a, in_b;
    for (int k = 0; k < kSampleSize; ++k) {
      in_a[k] = matches[sample[k]].point_in_a;
      in_b[k] = matches[sample[k]].point_in_b;
    }
    Sim3 candidate;
    if (!AlignSim3(in_a, in_b, &candidate)) continue;
    double cost = Cost(input, candidate, best_cost);
    if (!(cost < best_cost)) continue;
    for (int local = 0; local < kLocalIterations; ++local) {
      Sim3 refined = candidate;
      if (!AlignInliers(input, &refined)) break;
      const double refined_cost = Cost(input, refined, cost);
      if (!(refined_cost < cost)) break;
      candidate = refined;
      cost = refined_cost;
    }
    best = candidate;
    best_cost = cost;
    const int at_least = num_matches_ - static_cast<int>(cost);
    needed =
        std::min(needed, RansacTrials(at_least, num_matches_, kSampleSize, options.confidence, options.max_iterations));
  }
  if (!(best_cost < num_matches_)) return false;

  const Sim3 a_from_b = best.Inverse();
  int num_inliers = 0;
  for (int i = 0; i < num_matches_; ++i) {
    inliers_[i] = MatchCost(input, best, a_from_b, i) < 1.0 ? 1 : 0;
    num_inliers += inliers_[i];
  }
  if (num_inliers < min_inliers) {
    std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
    return false;
  }
  estimate->b_from_a = best;
  estimate->num_inliers = num_inliers;
  return true;
}

}  // namespace haustra
