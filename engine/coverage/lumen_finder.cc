#include "engine/coverage/lumen_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "engine/coverage/path_curve.h"
#include "hal/core/median.h"

namespace haustra {
namespace {

constexpr std::size_t kMinPositions = 10;
constexpr std::size_t kMinWallPoints = 200;
constexpr std::size_t kMaxWallPoints = 20000;  // more are thinned: a slice has hundreds anyway
constexpr std::size_t kMaxScalePlaces = 60;
constexpr int kIterations = 8;
constexpr int kDirections = 24;
constexpr int kMinPointsADirection = 2;
constexpr int kMinDirections = 6;        // fewer do not say where the middle is
constexpr double kStationShare = 0.25;   // of the radius, from station to station
constexpr double kSliceShare = 0.5;      // half the thickness of a slice: folds and what lies between them
constexpr double kReachShare = 2.2;      // farther from the line is another part of the lumen
constexpr double kExtensionShare = 1.5;  // beyond the path's ends
constexpr double kSmoothShare = 0.5;     // sigma of the corrections along the line
constexpr double kRadiusPrior = 3.0;     // counts as so many directions
constexpr double kCentrePrior = 1.0;
constexpr double kOutlierShare = 0.2;   // of the radius: Cauchy's scale
constexpr double kOnCircleShare = 0.3;  // of the radius: what lies nearer to the circle counts as on it

// A scope that slides along the wall is far nearer to it than the radius: the far wall is beyond the reach of the first
// guess, and a circle between the two is found, with little wall on it. Times that guess.
constexpr std::array<double, 3> kLargerGuesses{2.0, 4.0, 8.0};
constexpr double kClearlyBetter = 0.1;  // of the directions
constexpr double kInsideShare = 1.05;   // of the radius; half of the path has to lie within

std::vector<Eigen::Vector3d> FiniteOf(std::span<const Eigen::Vector3d> points) {
  std::vector<Eigen::Vector3d> finite;
  for (const Eigen::Vector3d& point : points) {
    if (point.allFinite()) finite.push_back(point);
  }
  return finite;
}

std::vector<Eigen::Vector3d> Thinned(std::span<const Eigen::Vector3d> points, std::size_t most) {
  const std::size_t stride = std::max<std::size_t>(1, (points.size() + most - 1) / most);
  std::vector<Eigen::Vector3d> thinned;
  for (std::size_t i = 0; i < points.size(); i += stride) thinned.push_back(points[i]);
  return thinned;
}

// A first guess: a scope in a tube is nearer to the wall than the radius, by a quarter or so. The fifth nearest point
// is taken, so that a wrong one does no harm.
double GuessRadius(std::span<const Eigen::Vector3d> path, const std::vector<Eigen::Vector3d>& wall) {
  constexpr std::size_t kNearest = 5;
  constexpr double kRadiusOverNearest = 1.3;
  std::vector<double> nearest;
  for (const Eigen::Vector3d& position : Thinned(path, kMaxScalePlaces)) {
    std::vector<double> distances;
    for (const Eigen::Vector3d& point : wall) distances.push_back((point - position).squaredNorm());
    std::nth_element(distances.begin(), distances.begin() + kNearest, distances.end());
    nearest.push_back(std::sqrt(distances[kNearest]));
  }
  return kRadiusOverNearest * UpperMedian(std::span<double>(nearest));
}

// What a slice of the wall says about a station.
struct Slice {
  int num_directions = 0;
  int num_on_circle = 0;  // of these, whose wall is near the circle
  double radius = 0.0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // off the station, along normal and binormal
};

// Gauss-Newton on the distances from the circle, with Cauchy's weights. The priors hold what few directions leave open.
Slice FitCircle(const std::vector<Eigen::Vector2d>& points, double radius) {
  Slice slice{static_cast<int>(points.size()), 0, radius, Eigen::Vector2d::Zero()};
  if (slice.num_directions < kMinDirections) return slice;
  for (int step = 0; step < 10; ++step) {
    Eigen::Matrix3d hessian = Eigen::Vector3d(kCentrePrior, kCentrePrior, kRadiusPrior).asDiagonal();
    Eigen::Vector3d gradient(kCentrePrior * slice.centre.x(), kCentrePrior * slice.centre.y(),
                             kRadiusPrior * (slice.radius - radius));
    for (const Eigen::Vector2d& point : points) {
      const Eigen::Vector2d offset = point - slice.centre;
      const double distance = std::max(offset.norm(), 1e-9 * radius);
      const double residual = distance - slice.radius;
      const double relative = residual / (kOutlierShare * radius);
      const double weight = 1.0 / (1.0 + relative * relative);
      const Eigen::Vector3d jacobian(-offset.x() / distance, -offset.y() / distance, -1.0);
      hessian += weight * jacobian * jacobian.transpose();
      gradient += weight * residual * jacobian;
    }
    const Eigen::Vector3d delta = hessian.ldlt().solve(-gradient);
    slice.centre += delta.head<2>();
    slice.radius += delta.z();
    if (delta.norm() < 1e-6 * radius) break;
  }
  slice.radius = std::clamp(slice.radius, 0.3 * radius, 2.0 * radius);
  if (slice.centre.norm() > radius) slice.centre *= radius / slice.centre.norm();
  for (const Eigen::Vector2d& point : points) {
    slice.num_on_circle += std::abs((point - slice.centre).norm() - slice.radius) < kOnCircleShare * slice.radius;
  }
  return slice;
}

std::vector<Slice> SlicesOf(const LumenLine& line, const std::vector<Eigen::Vector3d>& wall, double radius) {
  // Distances by station and direction.
  std::vector<std::vector<float>> distances(std::size_t(line.num_stations()) * kDirections);
  for (const Eigen::Vector3d& point : wall) {
    const WallCoordinates at = line.Of(point);
    if (at.radius_mu > kReachShare * radius) continue;
    const int first = static_cast<int>(std::ceil((at.length_mu - kSliceShare * radius) / line.step_mu()));
    const int last = static_cast<int>(std::floor((at.length_mu + kSliceShare * radius) / line.step_mu()));
    const double turn = at.angle_rad / (2.0 * std::numbers::pi);
    const int direction = static_cast<int>((turn - std::floor(turn)) * kDirections) % kDirections;
    for (int i = std::max(first, 0); i <= std::min(last, line.num_stations() - 1); ++i) {
      distances[std::size_t(i) * kDirections + direction].push_back(static_cast<float>(at.radius_mu));
    }
  }
  std::vector<Slice> slices;
  for (int i = 0; i < line.num_stations(); ++i) {
    std::vector<Eigen::Vector2d> points;
    for (int d = 0; d < kDirections; ++d) {
      std::vector<float>& all = distances[std::size_t(i) * kDirections + d];
      if (all.size() < kMinPointsADirection) continue;
      std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
      const double angle = 2.0 * std::numbers::pi * (d + 0.5) / kDirections;
      points.push_back(all[all.size() / 2] * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
    slices.push_back(FitCircle(points, radius));
  }
  return slices;
}

std::vector<Eigen::Vector3d> PositionsOf(const LumenLine& line) {
  std::vector<Eigen::Vector3d> positions;
  for (int i = 0; i < line.num_stations(); ++i) positions.push_back(line.station(i).position);
  return positions;
}

// Corrections of all stations, each the mean of those near it that know their middle.
std::vector<Eigen::Vector3d> Centred(const LumenLine& line, const std::vector<Slice>& slices, double radius) {
  const double sigma = kSmoothShare * radius / line.step_mu();
  const int reach = static_cast<int>(std::ceil(4.0 * sigma));
  std::vector<Eigen::Vector3d> centred = PositionsOf(line);
  for (int i = 0; i < line.num_stations(); ++i) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weights = 1e-3;  // far from any slice that knows: as it is
    for (int k = std::max(0, i - reach); k <= std::min(line.num_stations() - 1, i + reach); ++k) {
      if (slices[k].num_directions < kMinDirections) continue;
      const double away = (k - i) / sigma;
      const double weight = slices[k].num_directions * std::exp(-0.5 * away * away);
      const LumenFrame& frame = line.station(k);
      sum += weight * (slices[k].centre.x() * frame.normal + slices[k].centre.y() * frame.binormal);
      weights += weight;
    }
    centred[i] += sum / weights;
  }
  return centred;
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f", value);
  return text;
}

// The part of the line that the scope passed. A position far off the line is a wrong pose, or of another part.
void FindPassed(std::span<const Eigen::Vector3d> path, Lumen* lumen) {
  std::vector<double> lengths;
  for (const Eigen::Vector3d& position : path) {
    const WallCoordinates at = lumen->line.Of(position);
    if (at.radius_mu > 1.2 * lumen->radius_mu) continue;
    lengths.push_back(std::clamp(at.length_mu, 0.0, lumen->line.length_mu()));
  }
  if (lengths.empty()) return;
  const auto [first, last] = std::minmax_element(lengths.begin(), lengths.end());
  lumen->passed_begin_mu = *first;
  lumen->passed_end_mu = *last;
}

// A lumen, and how much of the wall around it lies on its circles.
struct LumenFit {
  Lumen lumen;
  double circle_share = 0.0;  // of the directions around the passed part
};

// A large guess may also find the circle of a bulge that the scope went past.
bool IsInside(std::span<const Eigen::Vector3d> path, const Lumen& lumen) {
  const auto num_inside = std::count_if(path.begin(), path.end(), [&](const Eigen::Vector3d& position) {
    return lumen.line.Of(position).radius_mu < kInsideShare * lumen.radius_mu;
  });
  return 2 * static_cast<std::size_t>(num_inside) > path.size();
}

Result<LumenFit> FitLumen(std::span<const Eigen::Vector3d> path, const std::vector<Eigen::Vector3d>& points,
                          double guess_mu) {
  LumenFit fit;
  Lumen& lumen = fit.lumen;
  lumen.radius_mu = guess_mu;
  const std::vector<Eigen::Vector3d> curve =
      lumen.radius_mu > 0.0 ? CurveThroughPath(path, lumen.radius_mu) : std::vector<Eigen::Vector3d>();
  if (curve.size() < 2) return NotFound("the scope stayed in one place");
  const LumenLine first(curve, kStationShare * lumen.radius_mu);
  const double extension = kExtensionShare * lumen.radius_mu;
  std::vector<Eigen::Vector3d> centres = PositionsOf(first);
  const int more = static_cast<int>(std::ceil(extension / first.step_mu()));
  // The direction of the ends is that of a radius of the path: its last piece may look any way.
  const Eigen::Vector3d begin_way =
      (centres[0] - first.At(std::min(lumen.radius_mu, first.length_mu())).position).normalized();
  const Eigen::Vector3d end_way =
      (centres.back() - first.At(std::max(first.length_mu() - lumen.radius_mu, 0.0)).position).normalized();
  const Eigen::Vector3d begin = centres.front(), end = centres.back();
  for (int i = 1; i <= more; ++i) {
    centres.insert(centres.begin(), begin + i * first.step_mu() * begin_way);
    centres.push_back(end + i * first.step_mu() * end_way);
  }
  std::vector<Slice> slices;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    lumen.line = LumenLine(centres, kStationShare * lumen.radius_mu);
    slices = SlicesOf(lumen.line, points, lumen.radius_mu);
    std::vector<double> radii;
    for (const Slice& slice : slices) {
      if (slice.num_directions >= kMinDirections) radii.push_back(slice.radius);
    }
    if (radii.empty()) return NotFound("no wall lies around the path of the scope");
    centres = SmoothCurve(Centred(lumen.line, slices, lumen.radius_mu), 0.5 * kSmoothShare * lumen.radius_mu);
    lumen.radius_mu = UpperMedian(std::span<double>(radii));
  }
  lumen.line = LumenLine(centres, kStationShare * lumen.radius_mu);
  slices = SlicesOf(lumen.line, points, lumen.radius_mu);
  FindPassed(path, &lumen);
  const double passed_radii = (lumen.passed_end_mu - lumen.passed_begin_mu) / lumen.radius_mu;
  if (passed_radii < kMinPassedRadii) {
    return NotFound("the scope moved along it by " + Number(passed_radii) + " radii, fewer than " +
                    Number(kMinPassedRadii));
  }
  double share = 0.0;
  int count = 0, num_on_circle = 0;
  for (int i = 0; i < lumen.line.num_stations(); ++i) {
    const double at = i * lumen.line.step_mu();
    if (at < lumen.passed_begin_mu || at > lumen.passed_end_mu) continue;
    share += static_cast<double>(slices[i].num_directions) / kDirections;
    num_on_circle += slices[i].num_on_circle;
    ++count;
  }
  lumen.wall_share = count > 0 ? share / count : 0.0;
  fit.circle_share = count > 0 ? static_cast<double>(num_on_circle) / (kDirections * count) : 0.0;
  if (lumen.wall_share < kMinWallShare) {
    return NotFound("a wall was found on " + Number(100.0 * lumen.wall_share) +
                    " % of the directions around the path, " + "fewer than " + Number(100.0 * kMinWallShare));
  }
  return fit;
}

}  // namespace

Result<Lumen> FindLumen(std::span<const Eigen::Vector3d> all_path, std::span<const Eigen::Vector3d> all_wall) {
  const std::vector<Eigen::Vector3d> path = FiniteOf(all_path), wall = FiniteOf(all_wall);
  if (path.size() < kMinPositions) return NotFound("only " + std::to_string(path.size()) + " frames have a pose");
  if (wall.size() < kMinWallPoints) {
    return NotFound("only " + std::to_string(wall.size()) + " points of the wall are known");
  }
  const std::vector<Eigen::Vector3d> points = Thinned(wall, kMaxWallPoints);
  const double guess_mu = GuessRadius(path, points);
  Result<LumenFit> best = FitLumen(path, points, guess_mu);
  // A guess more is a chance more to take for a lumen what is none: the wall has to lie on its circles.
  double least = std::max(kMinWallShare, best.ok() ? best->circle_share + kClearlyBetter : 0.0);
  for (const double factor : kLargerGuesses) {
    Result<LumenFit> fit = FitLumen(path, points, factor * guess_mu);
    if (!fit.ok() || fit->circle_share < least || !IsInside(path, fit->lumen)) continue;
    best = std::move(fit);
    least = best->circle_share;  // of equals the larger: the smaller may not have grown up in its rounds
  }
  if (!best.ok()) return best.status();
  return std::move(best->lumen);
}

}  // namespace haustra
