#include "engine/calibration/self_calibration.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <utility>

#include "engine/calibration/window_spread.h"

namespace haustra::calibration {
namespace {

// Focal lengths that the search begins from, shares of the window's width: 127, 88 and 57 degrees across.
constexpr std::array<double, 3> kFirstFocals = {0.45, 0.65, 1.0};
constexpr std::size_t kNumSearchWindows = 12;
constexpr int kSearchRounds = 3;
constexpr int kSearchIterations = 10;
constexpr double kScoreTolerancePx = 2.0;
// Another focal length that fits nearly as well may make the clip ambiguous.
constexpr double kRivalScore = 0.965;     // of the best one
constexpr double kRivalDistance = 0.12;   // of the logarithms
constexpr double kRivalAgreement = 0.03;  // likewise, once all windows are adjusted
constexpr int kRounds = 2;                // reconstructions with the intrinsics of the last
constexpr int kPassesPerRound = 4;        // adjustments, with noise, strain and weights of the last
constexpr int kNumSplits = 3;
constexpr double kOutlierNoises = 4.0;
constexpr std::size_t kMinPointsOfWindow = 30;
constexpr double kMinStrain = 0.0005, kMaxStrain = 0.05;
constexpr double kMaxCentreSigmas = 3.0;  // of the prior
// Clips that are refused are farther off than their parts differ by.
constexpr double kRefusedDoubt = 1.5;
constexpr int kCoverageCells = 10;  // along each side
constexpr int kMinInCell = 10;

template <typename... Numbers>
std::string Text(const char* format, Numbers... numbers) {
  char text[384];
  std::snprintf(text, sizeof(text), format, numbers...);
  return text;
}

// Well fitted observations, each counted by how well.
double Score(const Intrinsics& intrinsics, const std::vector<AdjustedWindow>& windows) {
  double score = 0.0;
  for (const AdjustedWindow& w : windows) {
    for (const PointObservation& o : w.reconstruction.observations) {
      Eigen::Vector2d pixel;
      if (!intrinsics.Project(PointInCamera(w.reconstruction, o), &pixel, nullptr, nullptr)) continue;
      const double error = (pixel - o.pixel).norm() / (kScoreTolerancePx * o.sigma_px);
      score += std::max(0.0, 1.0 - error * error);
    }
  }
  return score;
}

IntrinsicPrior PriorOf(const ScopeWindow& scope, const SelfCalibrationOptions& options) {
  IntrinsicPrior prior;
  prior.mean.focal_px = (scope.is_cut ? options.cut_focal_per_width : options.focal_per_width) * scope.width_px;
  prior.mean.cx = scope.centre_x_px;
  prior.mean.cy = scope.centre_y_px;
  prior.mean.k1 = scope.is_cut ? options.cut_k1 : options.k1;
  prior.mean.k2 = prior.k2_per_k1_squared * prior.mean.k1 * prior.mean.k1;
  const double centre = options.centre_sigma * scope.width_px;
  prior.sigma << (scope.is_cut ? options.cut_log_focal_sigma : options.log_focal_sigma), centre, centre,
      options.k1_sigma, options.k2_sigma;
  return prior;
}

class Estimator {
 public:
  Estimator(std::span<const FeatureWindow> windows, const ScopeWindow& scope, const SelfCalibrationOptions& options)
      : input_(windows), scope_(scope), options_(options), prior_(PriorOf(scope, options)) {
    order_.resize(windows.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return input_[a].observations.size() > input_[b].observations.size();
    });
    if (order_.size() > static_cast<std::size_t>(options.max_windows)) {
      order_.resize(static_cast<std::size_t>(options.max_windows));
    }
  }

  // Refused when the windows do not even give a guess.
  Result<CalibrationEstimate> Run() {
    if (static_cast<int>(order_.size()) < options_.min_windows) return TooFew(order_.size());
    HAUSTRA_ASSIGN(const Found found, Search());
    intrinsics_ = found.intrinsics;
    for (int round = 0; round < kRounds; ++round) {
      Rebuild(round == 0 ? 2.5 : 2.0, order_);
      if (static_cast<int>(windows_.size()) < options_.min_windows) return TooFew(windows_.size());
      Refine();
    }
    HAUSTRA_ASSIGN(CalibrationEstimate estimate, Measure());
    const std::vector<AdjustedWindow> all = windows_;
    estimate.sigma = SpreadOf(prior_, intrinsics_, windows_).cwiseMax(SpreadOfHalves(found.intrinsics));
    estimate.sigma[kLogFocal] = std::max(estimate.sigma[kLogFocal], found.rival_distance);
    estimate.verdict = found.verdict.ok() ? Judge(estimate) : found.verdict;
    if (!estimate.verdict.ok()) Guess(all, &estimate);
    return estimate;
  }

 private:
  struct Found {
    Intrinsics intrinsics;
    double rival_distance = 0.0;  // of the logarithms, to a focal length that explains the clip about as well
    Status verdict;
  };

  Status TooFew(std::size_t count) const {
    return FailedPrecondition(
        Text("%d pieces of the clip must be reconstructed, and %zu can be: it is short, the scope hardly moves or "
             "jumps from picture to picture, or these show too little that stays in place",
             options_.min_windows, count));
  }

  void Rebuild(double tolerance_px, std::span<const std::size_t> chosen) {
    ReconstructionOptions options;
    options.tolerance_px = tolerance_px;
    windows_.clear();
    for (const std::size_t i : chosen) {
      AdjustedWindow window;
      if (!Reconstruct(input_[i], intrinsics_, options, options_.seed + i, &window.reconstruction)) continue;
      windows_.push_back(std::move(window));
    }
  }

  // Each first guess is carried through on some windows; the best fit wins. Others that fit nearly as well must lead to
  // the same focal length when all windows are adjusted.
  Result<Found> Search() {
    std::array<double, kFirstFocals.size()> scores{};
    std::array<Intrinsics, kFirstFocals.size()> found;
    const std::span<const std::size_t> some = std::span(order_).first(std::min(kNumSearchWindows, order_.size()));
    for (std::size_t i = 0; i < kFirstFocals.size(); ++i) {
      intrinsics_ = prior_.mean;
      intrinsics_.focal_px = kFirstFocals[i] * scope_.width_px;
      for (int round = 0; round < kSearchRounds; ++round) {
        Rebuild(round == 0 ? 4.0 : 2.5, some);
        AdjustmentOptions adjustment;
        adjustment.max_iterations = kSearchIterations;
        AdjustJointly(prior_, adjustment, &intrinsics_, &windows_);
      }
      scores[i] = Score(intrinsics_, windows_);
      found[i] = intrinsics_;
    }
    const auto best = static_cast<std::size_t>(std::max_element(scores.begin(), scores.end()) - scores.begin());
    if (scores[best] <= 0.0) return TooFew(0);
    for (std::size_t i = 0; i < kFirstFocals.size(); ++i) {
      const double distance = std::log(found[i].focal_px / found[best].focal_px);
      if (scores[i] < kRivalScore * scores[best] || std::abs(distance) < kRivalDistance) continue;
      const double focal = RefinedFocal(found[best]), rival = RefinedFocal(found[i]);
      if (std::abs(std::log(rival / focal)) < kRivalAgreement) continue;
      return Found{found[best], std::abs(std::log(rival / focal)),
                   FailedPrecondition(Text("focal lengths of %.0f and %.0f px explain the clip about equally well; the "
                                           "scope must turn and move in front of walls near and far",
                                           focal, rival))};
    }
    return Found{found[best], 0.0, Status::Ok()};
  }

  double RefinedFocal(const Intrinsics& from) {
    intrinsics_ = from;
    Rebuild(2.5, order_);
    Refine();
    return intrinsics_.focal_px;
  }

  void Refine() {
    for (int pass = 0; pass < kPassesPerRound; ++pass) {
      for (AdjustedWindow& w : windows_) {
        if (pass == 0) break;
        w.noise_px = NoiseOf(intrinsics_, w.reconstruction);
        w.strain_sigma = std::clamp(std::sqrt(w.mean_square_strain), kMinStrain, kMaxStrain);
        DropOutliers(intrinsics_, kOutlierNoises * w.noise_px, &w.reconstruction);
        if (w.reconstruction.points.size() < kMinPointsOfWindow) w.weight = 0.0;
      }
      AdjustJointly(prior_, {}, &intrinsics_, &windows_);
      WeighWindows(prior_, intrinsics_, &windows_);
    }
    AdjustJointly(prior_, {}, &intrinsics_, &windows_);
  }

  // Half of what the two halves of the clip differ by, each adjusted by itself from the first guess on; over three ways
  // to halve it. Unlike the jackknife it sees what the choice of observations and of the valley does.
  IntrinsicVector SpreadOfHalves(const Intrinsics& first) {
    const Intrinsics whole = intrinsics_;
    IntrinsicVector squares = IntrinsicVector::Zero();
    std::vector<std::size_t> in_time = order_;
    std::sort(in_time.begin(), in_time.end());
    for (int split = 0; split < kNumSplits; ++split) {
      std::array<IntrinsicVector, 2> found;
      for (std::size_t half = 0; half < 2; ++half) {
        std::vector<std::size_t> chosen;
        for (std::size_t k = 0; k < in_time.size(); ++k) {
          const std::size_t side = split < 2 ? k / (2 + static_cast<std::size_t>(split)) % 2 : 2 * k / in_time.size();
          if (side == half) chosen.push_back(in_time[k]);
        }
        intrinsics_ = first;
        Rebuild(2.5, chosen);
        Refine();
        found[half] = intrinsics_.Vector();
      }
      squares += (0.5 * (found[0] - found[1])).cwiseAbs2() / kNumSplits;
    }
    intrinsics_ = whole;
    return squares.cwiseSqrt();
  }

  Status Judge(const CalibrationEstimate& estimate) const {
    const double spread = estimate.sigma[kLogFocal];
    if (!(spread <= options_.max_focal_spread)) {
      return FailedPrecondition(
          Text("the clip does not hold the focal length: it is %.0f px give or take %.0f (%.1f %%, "
               "at most %.1f are accepted); the scope must turn and move in front of walls near "
               "and far, and more of that helps",
               intrinsics_.focal_px, intrinsics_.focal_px * spread, 100.0 * spread, 100.0 * options_.max_focal_spread));
    }
    const double off = std::hypot(intrinsics_.cx - scope_.centre_x_px, intrinsics_.cy - scope_.centre_y_px);
    if (off > kMaxCentreSigmas * prior_.sigma[kCx]) {
      return FailedPrecondition(
          Text("the centre would lie %.0f px from that of the scope's window, which no scope's "
               "does: the scene moves too much in itself, or the picture was cut",
               off));
    }
    return Status::Ok();
  }

  // The clip and what is usual, together: the information of the clip counts as little as its parts differ. One step
  // from where both were last in balance, along the valley of focal length and distortion.
  void Guess(const std::vector<AdjustedWindow>& windows, CalibrationEstimate* estimate) const {
    IntrinsicMatrix clip = IntrinsicMatrix::Zero(), usual = IntrinsicMatrix::Zero();
    IntrinsicVector of_clip = IntrinsicVector::Zero(), of_usual = IntrinsicVector::Zero();
    for (const AdjustedWindow& w : windows) {
      clip += w.information;
      of_clip += w.gradient;
    }
    prior_.AddTo(intrinsics_, &usual, &of_usual);
    const IntrinsicVector formal = IntrinsicMatrix(clip + usual).inverse().diagonal();
    double excess = 1.0;  // of the variance
    for (const int i : {kLogFocal, kCx, kCy}) {
      excess = std::max(excess, estimate->sigma[i] * estimate->sigma[i] / std::max(1e-12, formal[i]));
    }
    const double share = 1.0 / (kRefusedDoubt * kRefusedDoubt * excess);
    const IntrinsicMatrix both = share * clip + usual;
    estimate->intrinsics = intrinsics_.Plus(-both.ldlt().solve(share * of_clip + of_usual));
    estimate->sigma = both.inverse().diagonal().cwiseMax(0.0).cwiseSqrt();
  }

  // Everything but the spread.
  Result<CalibrationEstimate> Measure() const {
    CalibrationEstimate estimate;
    estimate.intrinsics = intrinsics_;
    estimate.num_windows_offered = static_cast<int>(input_.size());
    double squares = 0.0;
    std::array<int, kCoverageCells * kCoverageCells> cells{};
    for (const AdjustedWindow& w : windows_) {
      if (w.weight <= 0.0) continue;
      ++estimate.num_windows;
      estimate.num_points += static_cast<int>(w.reconstruction.points.size());
      for (const PointObservation& o : w.reconstruction.observations) {
        Eigen::Vector2d pixel;
        if (!intrinsics_.Project(PointInCamera(w.reconstruction, o), &pixel, nullptr, nullptr)) continue;
        estimate.residuals.push_back({o.pixel, pixel - o.pixel});
        squares += (pixel - o.pixel).squaredNorm();
        const double x = (o.pixel.x() - scope_.centre_x_px) / scope_.width_px + 0.5;
        const double y = (o.pixel.y() - scope_.centre_y_px) / scope_.height_px + 0.5;
        if (x < 0.0 || y < 0.0 || x >= 1.0 || y >= 1.0) continue;
        ++cells[static_cast<std::size_t>(kCoverageCells * static_cast<int>(kCoverageCells * y) +
                                         static_cast<int>(kCoverageCells * x))];
      }
    }
    if (estimate.num_windows < options_.min_windows) return TooFew(static_cast<std::size_t>(estimate.num_windows));
    estimate.rms_px = std::sqrt(squares / static_cast<double>(estimate.residuals.size()));
    const auto num_covered = std::count_if(cells.begin(), cells.end(), [](int num) { return num >= kMinInCell; });
    estimate.coverage = static_cast<double>(num_covered) / static_cast<double>(cells.size());
    return estimate;
  }

  std::span<const FeatureWindow> input_;
  ScopeWindow scope_;
  SelfCalibrationOptions options_;
  IntrinsicPrior prior_;
  Intrinsics intrinsics_;
  std::vector<std::size_t> order_;  // windows by number of observations
  std::vector<AdjustedWindow> windows_;
};

}  // namespace

CalibrationEstimate EstimateIntrinsics(std::span<const FeatureWindow> windows, const ScopeWindow& scope,
                                       const SelfCalibrationOptions& options) {
  Result<CalibrationEstimate> estimate = Estimator(windows, scope, options).Run();
  return estimate.ok() ? std::move(estimate).value() : UsualIntrinsics(scope, options, estimate.status());
}

CalibrationEstimate UsualIntrinsics(const ScopeWindow& scope, const SelfCalibrationOptions& options, Status why) {
  const IntrinsicPrior prior = PriorOf(scope, options);
  CalibrationEstimate estimate;
  estimate.verdict = std::move(why);
  estimate.intrinsics = prior.mean;
  estimate.sigma = prior.sigma;
  return estimate;
}

}  // namespace haustra::calibration
