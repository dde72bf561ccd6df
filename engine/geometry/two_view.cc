#include "engine/geometry/two_view.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/geometry/constants.h"
#include "engine/geometry/five_point.h"
#include "engine/geometry/ransac_trials.h"
#include "engine/geometry/triangulation.h"

namespace haustra {
namespace {

constexpr int kSampleSize = 5;
constexpr int kMinMatches = 8;
constexpr int kLocalIterations = 4;
constexpr int kFinalIterations = 10;
constexpr double kMovingTolerances = 2.0;
constexpr double kMedianOfNormal = 0.6745;  // of the absolute value, in sigmas
constexpr int kStartDirections = 16;
// Directions of travel less far apart give much the same relief. A rival has at least this share of the best one's
// points in front: along the line of sight fewer of them move than across it.
constexpr double kRivalDirectionRad = 0.5;
constexpr double kMinRivalShare = 0.2;
constexpr double kMaxRivalRunnerUp = 0.3;  // a wall of which a third lies behind the camera explains nothing

// Square of the smallest joint turn (to first order) of both bearings that makes them meet: Sampson's distance on the
// unit sphere. The gradients are projected to the tangent planes, which takes the residual itself out of both.
double SampsonAngle2(const Eigen::Matrix3d& essential, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d line_b = essential * a;
  const double e = b.dot(line_b);
  const double gradient2 = line_b.squaredNorm() + (essential.transpose() * b).squaredNorm() - 2.0 * e * e;
  return e * e / std::max(gradient2, 1e-12);
}

Eigen::Matrix3d EssentialFromPose(const SE3& b_from_a) { return Skew(b_from_a.translation) * b_from_a.matrix3(); }

// One of the four poses behind an essential matrix; |translation| = 1.
SE3 PoseFromEssential(const Eigen::Matrix3d& essential) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d u = svd.matrixU(), v = svd.matrixV();
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Eigen::Matrix3d rotation = u * quarter_turn * v.transpose();
  if (rotation.determinant() < 0.0) rotation = -rotation;
  return SE3(rotation, Eigen::Vector3d(u.col(2)));
}

// The same essential matrix up to sign: cameras mirrored through the baseline, or the second turned half about it.
SE3 Mirrored(const SE3& pose) { return SE3(pose.rotation, -pose.translation); }
SE3 Twisted(const SE3& pose) {
  const Eigen::Quaterniond half_turn(0.0, pose.translation.x(), pose.translation.y(), pose.translation.z());
  return SE3(half_turn * pose.rotation, pose.translation);
}

// Of kStartDirections the i-th, evenly spread over half of the sphere (a Fibonacci lattice). The other half has the
// same essential matrices.
Eigen::Vector3d SpreadDirection(int i) {
  constexpr double kGoldenAngleRad = 2.399963229728653;
  const double z = 1.0 - (i + 0.5) / kStartDirections;
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(kGoldenAngleRad * i), r * std::sin(kGoldenAngleRad * i), z};
}

}  // namespace

double EpipolarScore(const SE3& b_from_a, std::span<const Eigen::Vector3d> bearings_a,
                     std::span<const Eigen::Vector3d> bearings_b, std::span<const double> tolerance_rad) {
  const Eigen::Matrix3d essential = EssentialFromPose(SE3(b_from_a.rotation, b_from_a.translation.normalized()));
  double score = 0.0;
  for (std::size_t i = 0; i < bearings_a.size(); ++i) {
    const double tolerance2 = tolerance_rad[i] * tolerance_rad[i];
    score += 1.0 - std::min(1.0, SampsonAngle2(essential, bearings_a[i], bearings_b[i]) / tolerance2);
  }
  return score;
}

TwoViewRansac::TwoViewRansac(int max_matches)
    : max_matches_(max_matches),
      inverse_tolerance2_(max_matches),
      inliers_(max_matches),
      points_in_a_(max_matches),
      parallax_rad_(max_matches),
      residual2_(max_matches) {}

double TwoViewRansac::Cost(const Eigen::Matrix3d& essential, double bound) const {
  double cost = 0.0;
  for (int i = 0; i < num_matches_ && cost < bound; ++i) {
    cost += std::min(1.0, SampsonAngle2(essential, bearings_a_[i], bearings_b_[i]) * inverse_tolerance2_[i]);
  }
  return cost;
}

int TwoViewRansac::Linearise(const SE3& b_from_a, const Eigen::Vector3d& u, const Eigen::Vector3d& v, Matrix5d* hessian,
                             Vector5d* gradient) const {
  const Eigen::Matrix3d rotation = b_from_a.matrix3();
  const Eigen::Vector3d t = b_from_a.translation;
  hessian->setZero();
  gradient->setZero();
  int used = 0;
  for (int i = 0; i < num_matches_; ++i) {
    const Eigen::Vector3d p = rotation * bearings_a_[i];
    const Eigen::Vector3d& b = bearings_b_[i];
    // e = b . (t x p); with unit vectors the squared gradient is 2 - (t . p)^2 - (t . b)^2 - 2 e^2.
    const Eigen::Vector3d e_by_t = p.cross(b);
    const double e = t.dot(e_by_t);
    const double tp = t.dot(p), tb = t.dot(b);
    const double gradient2 = std::max(2.0 - tp * tp - tb * tb - 2.0 * e * e, 1e-12);
    if (e * e / gradient2 * inverse_tolerance2_[i] >= 1.0) continue;
    ++used;
    const Eigen::Vector3d e_by_rotation = p.cross(b.cross(t));
    const Eigen::Vector3d half_by_rotation = -tp * p.cross(t) - 2.0 * e * e_by_rotation;
    const Eigen::Vector3d half_by_t = -tp * p - tb * b - 2.0 * e * e_by_t;
    const double inverse_norm = 1.0 / std::sqrt(gradient2);
    const double residual = e * inverse_norm;
    const double k = residual / gradient2;
    const Eigen::Vector3d by_rotation = inverse_norm * e_by_rotation - k * half_by_rotation;
    const Eigen::Vector3d by_t = inverse_norm * e_by_t - k * half_by_t;
    Vector5d jacobian;
    jacobian << by_rotation, by_t.dot(u), by_t.dot(v);
    const Vector5d weighted = inverse_tolerance2_[i] * jacobian;
    hessian->noalias() += weighted * jacobian.transpose();
    *gradient += residual * weighted;
  }
  return used;
}

// Gauss-Newton on the full derivative of the Sampson angle; the matches inside the tolerance are chosen anew at every
// step.
void TwoViewRansac::Refine(int iterations, SE3* b_from_a) const {
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const Eigen::Vector3d t = b_from_a->translation;
    const Eigen::Vector3d u = t.unitOrthogonal();
    const Eigen::Vector3d v = t.cross(u);
    Matrix5d hessian;
    Vector5d gradient;
    const int used = Linearise(*b_from_a, u, v, &hessian, &gradient);
    if (used < kMinMatches) return;
    // A trace of damping: along an unobservable direction (pure rotation) the step must stay finite.
    hessian.diagonal().array() += 1e-9 * hessian.trace();
    const Vector5d step = -hessian.ldlt().solve(gradient);
    if (!step.allFinite()) return;
    *b_from_a = SE3(ExpSO3(step.head<3>()) * b_from_a->rotation, (t + step[3] * u + step[4] * v).normalized());
    // Expected decrease of a cost whose unit is one tolerance squared.
    if (-gradient.dot(step) < 1e-10 * used) return;
  }
}

double TwoViewRansac::Descend(SE3* b_from_a) const {
  b_from_a->translation.normalize();
  Refine(kFinalIterations, b_from_a);
  return num_matches_ - Cost(EssentialFromPose(*b_from_a), std::numeric_limits<double>::infinity());
}

double TwoViewRansac::DirectionSigma(const SE3& b_from_a) const {
  const Eigen::Vector3d u = b_from_a.translation.unitOrthogonal();
  Matrix5d hessian;
  Vector5d gradient;
  Linearise(b_from_a, u, b_from_a.translation.cross(u), &hessian, &gradient);
  // What the direction keeps when the rotation is free: the Schur complement, whose smallest eigenvalue is the least
  // that is known along any axis.
  const Eigen::Matrix3d by_rotation = hessian.topLeftCorner<3, 3>();
  const Eigen::Matrix<double, 3, 2> mixed = hessian.topRightCorner<3, 2>();
  const Eigen::Matrix2d known = hessian.bottomRightCorner<2, 2>() - mixed.transpose() * by_rotation.ldlt().solve(mixed);
  const double mean = 0.5 * known.trace();
  const double least = mean - std::hypot(0.5 * (known(0, 0) - known(1, 1)), known(0, 1));
  if (!(least > 0.0)) return std::numeric_limits<double>::infinity();
  return 1.0 / (kGateOneDof * std::sqrt(least));
}

double TwoViewRansac::NoiseRatio(const SE3& b_from_a) {
  const Eigen::Matrix3d essential = EssentialFromPose(b_from_a);
  for (int i = 0; i < num_matches_; ++i) {
    residual2_[i] = SampsonAngle2(essential, bearings_a_[i], bearings_b_[i]) * inverse_tolerance2_[i];
  }
  const auto middle = residual2_.begin() + num_matches_ / 2;
  std::nth_element(residual2_.begin(), middle, residual2_.begin() + num_matches_);
  return std::max(1.0, kGateOneDof * std::sqrt(*middle) / kMedianOfNormal);
}

bool TwoViewRansac::ChooseDecomposition(const Options& options, SE3* b_from_a, int* num_in_front) const {
  const SE3 twisted = Twisted(*b_from_a);
  const std::array<SE3, 4> candidates = {*b_from_a, Mirrored(*b_from_a), twisted, Mirrored(twisted)};
  const Eigen::Matrix3d essential = EssentialFromPose(*b_from_a);
  std::array<int, 4> votes{};
  for (int i = 0; i < num_matches_; ++i) {
    const double inverse_tolerance2 = inverse_tolerance2_[i];
    if (SampsonAngle2(essential, bearings_a_[i], bearings_b_[i]) * inverse_tolerance2 >= 1.0) continue;
    for (int k = 0; k < 4; ++k) {
      Triangulated point;
      if (!TriangulateBearings(candidates[k], bearings_a_[i], bearings_b_[i], &point)) continue;
      // A ray that hardly turned has no side: noise decides on which it lies.
      const double sine2 = 1.0 - point.cos_parallax * point.cos_parallax;
      if (sine2 * inverse_tolerance2 > kMovingTolerances * kMovingTolerances) ++votes[k];
    }
  }
  const int best = static_cast<int>(std::max_element(votes.begin(), votes.end()) - votes.begin());
  for (int k = 0; k < 4; ++k) {
    if (k != best && votes[k] >= options.max_runner_up_share * votes[best]) return false;
  }
  *b_from_a = candidates[best];
  *num_in_front = votes[best];
  return votes[best] > 0;
}

// A plane n . X = 1 (camera a, units of the baseline) maps bearings by H = R + t n', and H has a second factorisation
// of the same form (Longuet-Higgins 1986, "The reconstruction of a plane surface from two perspective projections").
// With H = R G, G = I + tau n', tau = R' t and m = tau + |tau|^2 / 2 n one finds G' G = I + n m' + m n', symmetric in n
// and m: the twin has the plane m, and G = R2 (I + w m') with w = n - |tau|^2 |n|^2 / (2 |m|^2) m.
bool TwoViewRansac::PlanarTwin(const SE3& b_from_a, SE3* twin) const {
  // The plane from n . bearing = 1 / distance, in which the noise of every match weighs about the same; three rounds in
  // which matches far off the plane count less.
  Eigen::Vector3d n = Eigen::Vector3d::Zero();
  double spread = std::numeric_limits<double>::infinity();
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (int i = 0; i < num_matches_; ++i) {
      if (!inliers_[i]) continue;
      const double inverse_distance = 1.0 / points_in_a_[i].norm();
      const double off = std::abs(n.dot(bearings_a_[i]) - inverse_distance);
      const double weight = off > spread ? spread / off : 1.0;
      hessian += weight * bearings_a_[i] * bearings_a_[i].transpose();
      right += weight * inverse_distance * bearings_a_[i];
    }
    n = hessian.ldlt().solve(right);
    if (!n.allFinite()) return false;
    double sum = 0.0;
    int count = 0;
    for (int i = 0; i < num_matches_; ++i) {
      if (!inliers_[i]) continue;
      sum += std::abs(n.dot(bearings_a_[i]) - 1.0 / points_in_a_[i].norm());
      ++count;
    }
    if (count == 0) return false;
    spread = sum / count;
  }

  const Eigen::Vector3d tau = b_from_a.rotation.conjugate() * b_from_a.translation;
  const Eigen::Vector3d m = tau + 0.5 * tau.squaredNorm() * n;
  if (!(m.squaredNorm() > 1e-12)) return false;
  const Eigen::Vector3d w = n - (0.5 * tau.squaredNorm() * n.squaredNorm() / m.squaredNorm()) * m;
  const double scale = 1.0 + m.dot(w);
  if (!(std::abs(scale) > 1e-9) || !(w.norm() > 1e-9)) return false;
  const Eigen::Matrix3d g = Eigen::Matrix3d::Identity() + tau * n.transpose();
  const Eigen::Quaterniond turn(Eigen::Matrix3d(g * (Eigen::Matrix3d::Identity() - w * m.transpose() / scale)));
  *twin = SE3(b_from_a.rotation * turn.normalized(), Eigen::Vector3d::Zero());
  twin->translation = (twin->rotation * w).normalized();
  return twin->rotation.coeffs().allFinite() && twin->translation.allFinite();
}

bool TwoViewRansac::LookForRivals(const Options& options, SE3* b_from_a, double* cost, int* num_in_front) {
  if (options.min_rival_lead <= 0.0) return true;
  struct Minimum {
    SE3 b_from_a;
    double cost = 0.0;
    int num_in_front = 0;
  };
  std::array<Minimum, kStartDirections + 2> minima;
  auto end = minima.begin();
  *end++ = {*b_from_a, *cost, *num_in_front};
  Options one_sided;
  one_sided.max_runner_up_share = std::min(options.max_runner_up_share, kMaxRivalRunnerUp);
  const auto descend = [&](const SE3& start) {
    const double bound = *cost + options.min_rival_lead;
    Minimum minimum{start};
    Refine(kFinalIterations, &minimum.b_from_a);
    minimum.cost = Cost(EssentialFromPose(minimum.b_from_a), bound);
    if (minimum.cost < bound && ChooseDecomposition(one_sided, &minimum.b_from_a, &minimum.num_in_front)) {
      *end++ = minimum;
    }
  };
  SE3 twin;
  Triangulate(*b_from_a);
  if (PlanarTwin(*b_from_a, &twin)) descend(twin);
  for (int i = 0; i < kStartDirections; ++i) {
    if (options.should_stop && options.should_stop()) return false;
    descend(SE3(b_from_a->rotation, SpreadDirection(i)));
  }
  const Minimum best =
      *std::min_element(minima.begin(), end, [](const Minimum& a, const Minimum& b) { return a.cost < b.cost; });
  has_rival_ = std::any_of(minima.begin(), end, [&](const Minimum& rival) {
    return rival.cost < best.cost + options.min_rival_lead && rival.num_in_front > kMinRivalShare * best.num_in_front &&
           rival.b_from_a.translation.dot(best.b_from_a.translation) < std::cos(kRivalDirectionRad);
  });
  *b_from_a = best.b_from_a;
  *cost = best.cost;
  *num_in_front = best.num_in_front;
  return true;
}

int TwoViewRansac::Triangulate(const SE3& b_from_a) {
  const Eigen::Matrix3d essential = EssentialFromPose(b_from_a);
  int num_inliers = 0;
  for (int i = 0; i < num_matches_; ++i) {
    Triangulated point;
    inliers_[i] = 0;
    if (SampsonAngle2(essential, bearings_a_[i], bearings_b_[i]) * inverse_tolerance2_[i] >= 1.0) continue;
    if (!TriangulateBearings(b_from_a, bearings_a_[i], bearings_b_[i], &point)) continue;
    inliers_[i] = 1;
    points_in_a_[i] = point.point_in_a;
    parallax_rad_[i] = std::acos(std::clamp(point.cos_parallax, -1.0, 1.0));
    ++num_inliers;
  }
  return num_inliers;
}

// Of the two rotations behind one essential matrix the smaller parallax counts.
int TwoViewRansac::NumStill(const SE3& b_from_a, const Options& options) const {
  const Eigen::Matrix3d essential = EssentialFromPose(b_from_a);
  const std::array<Eigen::Matrix3d, 2> rotations = {b_from_a.matrix3(), Twisted(b_from_a).matrix3()};
  std::array<int, 2> num_moving{};
  int num_explained = 0;
  for (int i = 0; i < num_matches_; ++i) {
    if (SampsonAngle2(essential, bearings_a_[i], bearings_b_[i]) * inverse_tolerance2_[i] >= 1.0) continue;
    ++num_explained;
    for (int k = 0; k < 2; ++k) {
      const double sine2 = (rotations[k] * bearings_a_[i]).cross(bearings_b_[i]).squaredNorm();
      if (sine2 * inverse_tolerance2_[i] > kMovingTolerances * kMovingTolerances) ++num_moving[k];
    }
  }
  const double enough = std::max<double>(options.min_moving_share * num_explained, kMinMatches);
  return std::min(num_moving[0], num_moving[1]) < enough ? num_explained : 0;
}

bool TwoViewRansac::Run(std::span<const Eigen::Vector3d> bearings_a, std::span<const Eigen::Vector3d> bearings_b,
                        std::span<const double> tolerance_rad, const Options& options, Rng& rng, Estimate* estimate) {
  num_matches_ = 0;
  has_rival_ = false;
  num_still_ = 0;
  const int min_inliers = std::max(options.min_inliers, kMinMatches);
  if (bearings_a.size() > static_cast<std::size_t>(max_matches_)) return false;
  num_matches_ = static_cast<int>(bearings_a.size());
  std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
  if (bearings_b.size() != bearings_a.size() || tolerance_rad.size() != bearings_a.size()) return false;
  if (num_matches_ < min_inliers) return false;
  bearings_a_ = bearings_a;
  bearings_b_ = bearings_b;
  for (int i = 0; i < num_matches_; ++i) inverse_tolerance2_[i] = 1.0 / (tolerance_rad[i] * tolerance_rad[i]);

  SE3 best;
  double best_cost = std::numeric_limits<double>::infinity();
  int needed = options.max_iterations;
  const auto is_stopped = [&options] { return options.should_stop && options.should_stop(); };
  for (int iteration = 0; iteration < needed; ++iteration) {
    if (is_stopped()) return false;
    std::array<int, kSampleSize> sample;
    rng.SampleDistinct(num_matches_, sample);
    std::array<Eigen::Vector3d, kSampleSize> sample_a, sample_b;
    for (int k = 0; k < kSampleSize; ++k) {
      sample_a[k] = bearings_a[sample[k]];
      sample_b[k] = bearings_b[sample[k]];
    }
    std::array<Eigen::Matrix3d, 10> essentials;
    const int num_essentials = SolveFivePoint(sample_a, sample_b, &essentials);
    for (int k = 0; k < num_essentials; ++k) {
      double cost = Cost(essentials[k], best_cost);
      if (!(cost < best_cost)) continue;
      SE3 pose = PoseFromEssential(essentials[k]);
      SE3 refined = pose;
      Refine(kLocalIterations, &refined);
      const double refined_cost = Cost(EssentialFromPose(refined), cost);
      if (refined_cost < cost) {
        cost = refined_cost;
        pose = refined;
      }
      best = pose;
      best_cost = cost;
      const int at_least = num_matches_ - static_cast<int>(cost);
      needed = std::min(needed,
                        RansacTrials(at_least, num_matches_, kSampleSize, options.confidence, options.max_iterations));
    }
  }
  if (!(best_cost < num_matches_) || is_stopped()) return false;

  SE3 refined = best;
  Refine(kFinalIterations, &refined);
  const double refined_cost = Cost(EssentialFromPose(refined), best_cost);
  if (refined_cost < best_cost) {
    best = refined;
    best_cost = refined_cost;
  }

  int num_inliers = 0, num_moving = 0, num_in_front = 0;
  if (ChooseDecomposition(options, &best, &num_in_front)) {
    if (LookForRivals(options, &best, &best_cost, &num_in_front)) num_inliers = Triangulate(best);
    for (int i = 0; i < num_matches_; ++i) {
      if (inliers_[i] &&
          parallax_rad_[i] * parallax_rad_[i] * inverse_tolerance2_[i] > kMovingTolerances * kMovingTolerances) {
        ++num_moving;
      }
    }
  }
  // Where nothing moves every motion is a rival of every other.
  const bool is_found =
      num_inliers >= min_inliers && num_moving >= options.min_moving_share * num_inliers && num_moving >= kMinMatches;
  has_rival_ = has_rival_ && is_found;
  if (!is_found || has_rival_) {
    if (!is_found) num_still_ = NumStill(best, options);
    std::fill_n(inliers_.begin(), num_matches_, std::uint8_t{0});
    return false;
  }
  estimate->b_from_a = best;
  estimate->num_inliers = num_inliers;
  estimate->score = num_matches_ - best_cost;
  estimate->direction_sigma_rad = DirectionSigma(best);
  estimate->noise_ratio = NoiseRatio(best);
  return true;
}

}  // namespace haustra
