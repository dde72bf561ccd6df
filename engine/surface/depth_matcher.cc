#include "engine/surface/depth_matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/camera/dark_surround.h"
#include "engine/camera/lit_window.h"
#include "hal/core/check.h"
#include "hal/depth_search.h"

namespace haustra {
namespace {

using namespace depth_search;

constexpr double kRangeMargin = 2.0;    // beyond the seeds
constexpr double kSeedQuantile = 0.02;  // of the seeds' ranges that are taken for wrong, at each end
// Of a cell, along its row and its column. All are of the other colour of the checkerboard: none of them changes while
// the cell does. Each may have its plane, and is continued by it: what lies behind the edge of a fold and has little
// texture shall go on like the wall around it, not like the cell beside it.
constexpr std::array<int, kNumNeighbours / 4> kNeighbourDistances{1, 3, 5, 9};

// Evenly spread in [-1, 1), the same on every machine: SplitMix64 (Steele, Lea, Flood 2014) of what it is for.
double Noise(int cell, int iteration, int which) {
  std::uint64_t z = (static_cast<std::uint64_t>(cell) << 20) + static_cast<std::uint64_t>(iteration * 16 + which);
  z = (z + 1) * 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  z ^= z >> 31;
  return static_cast<double>(z >> 11) * (2.0 / 9007199254740992.0) - 1.0;
}

}  // namespace

DepthMatcher::DepthMatcher(const CameraModel& camera, ImageView mask, const DepthOptions& options)
    : camera_(camera),
      options_(options),
      max_cosine_(std::cos(options.min_parallax_deg * std::numbers::pi / 180.0)),
      width_(camera.width_px() / options.step_px),
      height_(camera.height_px() / options.step_px),
      seed_grid_(width_, height_),
      median_(width_, height_),
      sampler_(options.window_radius) {
  HAUSTRA_CHECK(options.Validate().ok());
  has_mask_ = !mask.is_empty();
  const std::size_t num_cells = std::size_t(width_) * height_;
  is_scene_.assign(std::size_t(camera.width_px()) * camera.height_px(), 1);
  if (!mask.is_empty()) {
    HAUSTRA_CHECK(mask.width == camera.width_px() && mask.height == camera.height_px());
    for (int y = 0; y < mask.height; ++y) {
      for (int x = 0; x < mask.width; ++x) is_scene_[std::size_t(y) * mask.width + x] = mask.row(y)[x] >= 128;
    }
  }
  cells_.resize(num_cells);
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      Cell& cell = cells_[std::size_t(y) * width_ + x];
      cell.centre_x = CellCentrePx(x, options.step_px);
      cell.centre_y = CellCentrePx(y, options.step_px);
      Eigen::Vector3d left, right, up, down;
      const auto ray = [&](double dx, double dy, Eigen::Vector3d* bearing) {
        return camera_.Unproject({cell.centre_x + dx, cell.centre_y + dy}, bearing);
      };
      cell.is_usable =
          ray(0, 0, &cell.bearing) && ray(-1, 0, &left) && ray(1, 0, &right) && ray(0, -1, &up) && ray(0, 1, &down) &&
          is_scene_[std::size_t(std::lround(cell.centre_y)) * camera.width_px() + std::lround(cell.centre_x)];
      if (!cell.is_usable) {
        cell.bearing.setZero();
        continue;
      }
      cell.bearing_dx = 0.5 * (right - left);
      cell.bearing_dy = 0.5 * (down - up);
    }
  }
  const auto single = [](const Eigen::Vector3d& v) {
    return std::array<float, 3>{static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
  };
  solver_cells_.reserve(num_cells);
  for (const Cell& cell : cells_) {
    solver_cells_.push_back({single(cell.bearing), single(cell.bearing_dx), single(cell.bearing_dy),
                             static_cast<float>(cell.centre_x), static_cast<float>(cell.centre_y), cell.is_usable});
  }
  estimates_.resize(num_cells);
  first_.resize(num_cells);
  weight_.resize(num_cells * sampler_.padded_size());
  pattern_.resize(num_cells * sampler_.padded_size());
  variance_.resize(num_cells);
  sources_.resize(options.max_sources);
}

DepthSolverPlan DepthMatcher::SolverSizes(const CameraModel& camera, const DepthOptions& options) {
  DepthSolverPlan plan;
  plan.camera = camera.projection_constants();
  plan.width_px = camera.width_px();
  plan.height_px = camera.height_px();
  plan.width = camera.width_px() / options.step_px;
  plan.height = camera.height_px() / options.step_px;
  plan.options = options;
  return plan;
}

DepthSolverPlan DepthMatcher::solver_plan() const {
  DepthSolverPlan plan = SolverSizes(camera_, options_);
  plan.cells = solver_cells_;
  plan.is_scene = is_scene_;
  return plan;
}

void DepthMatcher::SearchOn(DepthSolver* solver) {
  solver_ = solver;
  solver_sources_.resize(sources_.size());
  solver_planes_.resize(3 * cells_.size());
  solver_ranges_.resize(cells_.size());
  solver_confidences_.resize(cells_.size());
}

std::size_t DepthMatcher::BytesFor(int width_px, int height_px, const DepthOptions& options) {
  const auto num_cells = static_cast<std::size_t>(width_px / options.step_px) * (height_px / options.step_px);
  const std::size_t per_cell = sizeof(Cell) + sizeof(DepthCell) + sizeof(Estimate) + sizeof(InversePlane) +
                               (2 * WindowSampler::PaddedSize(options.window_radius) + 1) * sizeof(float);
  // With a solver: planes, range and confidence of each cell.
  constexpr std::size_t kOfSolver = 4 * sizeof(float) + sizeof(std::uint8_t);
  return static_cast<std::size_t>(width_px) * height_px + num_cells * (per_cell + kOfSolver) +
         DepthMedian::BytesFor(static_cast<int>(num_cells)) + WindowSampler::BytesFor(options.window_radius) +
         SeedGrid::BytesFor(width_px / options.step_px, height_px / options.step_px);
}

void DepthMatcher::PrepareWindows(ImageView grey) {
  const int radius = options_.window_radius, step = options_.window_step_px;
  const double sigma_px = radius * step * 0.75;
  for (int i = 0; i < static_cast<int>(cells_.size()); ++i) {
    const Cell& cell = cells_[i];
    if (!cell.is_usable) continue;
    float* weight = &weight_[std::size_t(i) * sampler_.padded_size()];
    float* pattern = &pattern_[std::size_t(i) * sampler_.padded_size()];
    float sum = 0.0f, full = 0.0f, mean = 0.0f;
    int k = 0;
    for (int v = -radius; v <= radius; ++v) {
      for (int u = -radius; u <= radius; ++u, ++k) {
        // The grid of a cell may lie between pixels: the mean of the four around is the value there.
        const double x = cell.centre_x + u * step, y = cell.centre_y + v * step;
        const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
        const float distance = static_cast<float>((u * u + v * v) * step * step / (2.0 * sigma_px * sigma_px));
        const float spatial = std::exp(-distance);
        full += spatial;
        weight[k] = 0.0f;
        pattern[k] = 0.0f;
        if (x0 < 0 || y0 < 0 || x0 + 1 >= grey.width || y0 + 1 >= grey.height) continue;
        const float fx = static_cast<float>(x - x0), fy = static_cast<float>(y - y0);
        const std::uint8_t* row = grey.row(y0) + x0;
        const std::uint8_t* below = grey.row(y0 + 1) + x0;
        if (std::max({row[0], row[1], below[0], below[1]}) >= kGlare) continue;
        if (!is_scene_[std::size_t(y0) * grey.width + x0]) continue;
        weight[k] = spatial;
        pattern[k] = (1 - fy) * ((1 - fx) * row[0] + fx * row[1]) + fy * ((1 - fx) * below[0] + fx * below[1]);
        sum += spatial;
        mean += spatial * pattern[k];
      }
    }
    variance_[i] = -1.0f;  // not enough of it
    if (sum < kMinWindowWeight * full) continue;
    mean /= sum;
    float variance = 0.0f;
    const int num_samples = k;
    for (k = 0; k < num_samples; ++k) {
      weight[k] /= sum;
      const float deviation = weight[k] > 0.0f ? pattern[k] - mean : 0.0f;
      pattern[k] = weight[k] * deviation;
      variance += pattern[k] * deviation;
    }
    variance_[i] = variance;
  }
}

float DepthMatcher::SourceCost(int i, const InversePlane& plane, const Source& source, bool* is_seen) const {
  const Cell& cell = cells_[i];
  *is_seen = false;
  // The point at b / (p . b) is seen by the source along R b + t (p . b).
  const double inverse_range = plane.dot(cell.bearing);
  const Eigen::Vector3d ray = source.rotation * cell.bearing + source.translation * inverse_range;
  // The angle at the wall between both rays.
  const Eigen::Vector3d turned = source.rotation * cell.bearing;
  const double cosine = turned.dot(ray) / ray.norm();
  if (cosine > max_cosine_) return kNoCost;
  Eigen::Vector2d pixel;
  CameraModel::ProjectionJacobian jacobian;
  if (!camera_.Project(ray, &pixel, &jacobian)) return kNoCost;
  const int width = camera_.width_px(), height = camera_.height_px();
  if (!(pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < width - 1 && pixel.y() < height - 1)) return kNoCost;
  if (!is_scene_[static_cast<std::size_t>(pixel.y()) * width + static_cast<std::size_t>(pixel.x())]) return kNoCost;
  const Eigen::Vector2d dx =
      jacobian * (source.rotation * cell.bearing_dx + source.translation * plane.dot(cell.bearing_dx));
  const Eigen::Vector2d dy =
      jacobian * (source.rotation * cell.bearing_dy + source.translation * plane.dot(cell.bearing_dy));
  const int radius = options_.window_radius, step = options_.window_step_px;
  const auto ux = static_cast<float>(dx.x() * step), uy = static_cast<float>(dx.y() * step);
  const auto vx = static_cast<float>(dy.x() * step), vy = static_cast<float>(dy.y() * step);
  const auto px = static_cast<float>(pixel.x()), py = static_cast<float>(pixel.y());
  // All corners inside, so that no sample has to ask.
  const float reach_x = radius * (std::abs(ux) + std::abs(vx)), reach_y = radius * (std::abs(uy) + std::abs(vy));
  if (px - reach_x < 0.0f || py - reach_y < 0.0f || px + reach_x >= width - 1 || py + reach_y >= height - 1) {
    return kNoCost;
  }
  *is_seen = true;
  const std::size_t window = std::size_t(i) * sampler_.padded_size();
  const WindowSums sums = sampler_.Sum(source.grey, {px, py, ux, uy, vx, vy}, &weight_[window], &pattern_[window]);
  const auto noise = static_cast<float>(options_.noise_grey * options_.noise_grey);
  const float variance = std::max(sums.squares - sums.values * sums.values, 0.0f);
  return 1.0f - sums.products / std::sqrt((variance + noise) * (variance_[i] + noise));
}

float DepthMatcher::DataCost(int cell, const InversePlane& plane) const {
  if (variance_[cell] < 0.0f) return kNoCost;
  std::array<float, kMaxDepthSources> best;
  int count = 0;
  for (int s = 0; s < num_sources_; ++s) {
    bool is_seen = false;
    const float cost = SourceCost(cell, plane, sources_[s], &is_seen);
    if (!is_seen) continue;
    int place = count < options_.best_sources ? count++ : count;
    if (place == options_.best_sources && cost >= best[place - 1]) continue;
    if (place == options_.best_sources) --place;
    for (; place > 0 && best[place - 1] > cost; --place) best[place] = best[place - 1];
    best[place] = cost;
  }
  if (count == 0) return kNoCost;
  float sum = 0.0f;
  for (int i = 0; i < count; ++i) sum += best[i];
  return sum / static_cast<float>(count);
}

bool DepthMatcher::IsPossible(int cell, const InversePlane& plane) const {
  const double inverse_range = plane.dot(cells_[cell].bearing);
  if (!(inverse_range >= min_inverse_ && inverse_range <= max_inverse_)) return false;
  return inverse_range > kMinSlantSine * plane.norm();
}

int DepthMatcher::NeighbourOf(int cell, int which) const {
  const int distance = kNeighbourDistances[which / 4], side = which % 4;
  const int x = cell % width_ + (side == 0 ? -distance : side == 1 ? distance : 0);
  const int y = cell / width_ + (side == 2 ? -distance : side == 3 ? distance : 0);
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return -1;
  const int neighbour = y * width_ + x;
  return cells_[neighbour].is_usable ? neighbour : -1;
}

double DepthMatcher::SmoothCost(int cell, const InversePlane& plane) const {
  const Eigen::Vector3d& bearing = cells_[cell].bearing;
  const double inverse_range = plane.dot(bearing);
  const double scale = 1.0 / (options_.smooth_step * inverse_range);
  double sum = 0.0;
  int count = 0;
  for (int k = 0; k < kNumNeighbours; ++k) {
    const int neighbour = NeighbourOf(cell, k);
    if (neighbour < 0) continue;
    sum += std::min(std::abs(estimates_[neighbour].plane.dot(bearing) - inverse_range) * scale, 1.0);
    ++count;
  }
  const double from_seed = std::abs(first_[cell].dot(bearing) - inverse_range) / (kSeedReach * inverse_range);
  return options_.smoothness * sum / std::max(count, 1) + kSeedPull * std::min(from_seed, 1.0);
}

double DepthMatcher::TotalCost(int cell, const Estimate& estimate) const {
  return estimate.data + SmoothCost(cell, estimate.plane);
}

void DepthMatcher::Consider(int cell, const InversePlane& plane, Estimate* best, double* best_cost) const {
  if (!IsPossible(cell, plane)) return;
  const double smooth = SmoothCost(cell, plane);
  if (smooth >= *best_cost) return;  // a correlation costs nothing at the least
  const Estimate estimate{plane, DataCost(cell, plane)};
  const double cost = estimate.data + smooth;
  if (cost >= *best_cost) return;
  *best = estimate;
  *best_cost = cost;
}

void DepthMatcher::Improve(int cell, int iteration) {
  Estimate best = estimates_[cell];
  double cost = TotalCost(cell, best);
  const int num_neighbours = iteration > 1 ? kNumNearNeighbours : kNumNeighbours;  // later on what is far off is known
  for (int k = 0; k < num_neighbours; ++k) {
    const int neighbour = NeighbourOf(cell, k);
    if (neighbour >= 0) Consider(cell, estimates_[neighbour].plane, &best, &cost);
  }
  if (iteration == 0) Consider(cell, first_[cell], &best, &cost);
  const Eigen::Vector3d& bearing = cells_[cell].bearing;
  const double shrink = std::ldexp(1.0, -iteration);
  for (int trial = 0; trial < 4; ++trial) {
    const double inverse_range = best.plane.dot(bearing);
    Eigen::Vector3d across = best.plane - inverse_range * bearing;
    double along = inverse_range;
    // Range alone, slant alone, both, and both by little.
    const double size = shrink * (trial == 3 ? 0.25 : 1.0);
    if (trial != 1) along *= 1.0 + kFirstDepthStep * size * Noise(cell, iteration, trial * 4);
    if (trial != 0) {
      const Eigen::Vector3d turn(Noise(cell, iteration, trial * 4 + 1), Noise(cell, iteration, trial * 4 + 2),
                                 Noise(cell, iteration, trial * 4 + 3));
      across += kFirstSlantStep * size * inverse_range * (turn - turn.dot(bearing) * bearing);
    }
    Consider(cell, along * bearing + across, &best, &cost);
  }
  estimates_[cell] = best;
}

double DepthMatcher::StepOfOnePixel(int cell, const InversePlane& plane) const {
  const Eigen::Vector3d& bearing = cells_[cell].bearing;
  const double inverse_range = plane.dot(bearing);
  double most = 0.0;
  for (int s = 0; s < num_sources_; ++s) {
    const Source& source = sources_[s];
    Eigen::Vector2d here, there;
    const Eigen::Vector3d turned = source.rotation * bearing;
    constexpr double kProbe = 1e-3;
    if (!camera_.Project(turned + source.translation * inverse_range, &here) || !camera_.IsInImage(here)) continue;
    if (!camera_.Project(turned + source.translation * (inverse_range * (1.0 + kProbe)), &there)) continue;
    most = std::max(most, (there - here).norm() / kProbe);
  }
  return most > 1.0 ? 1.0 / most : 0.0;
}

void DepthMatcher::Answer(int cell, DepthMap* map) const {
  const Estimate& estimate = estimates_[cell];
  const Eigen::Vector3d& bearing = cells_[cell].bearing;
  if (estimate.data >= kNoCost) return;
  const double step = StepOfOnePixel(cell, estimate.plane);
  if (step == 0.0) return;
  // The minimum of the parabola through three costs, half a pixel apart; the slant stays.
  const double inverse_range = estimate.plane.dot(bearing);
  const auto cost_at = [&](double pixels) {
    const double moved = inverse_range * pixels * step;
    return static_cast<double>(DataCost(cell, estimate.plane + moved * bearing));
  };
  const double below = cost_at(-0.5), above = cost_at(0.5), middle = estimate.data;
  const double curvature = below + above - 2.0 * middle;
  double shift = 0.0;
  if (curvature > 1e-6) shift = std::clamp(0.25 * (below - above) / curvature, -0.5, 0.5);
  const double rise = 0.5 * (cost_at(-1.0) + cost_at(1.0)) - middle;
  const double match = std::clamp(1.0 - middle, 0.0, 1.0), peak = std::clamp(rise / kSharpPeak, 0.0, 1.0);
  // Where the pictures say little, the neighbours have the word, and a parabola through noise has not.
  const double refined = inverse_range * (1.0 + shift * step * peak);
  map->Set(cell, refined, static_cast<int>(std::lround(1.0 + 254.0 * match * peak)));
}

Status DepthMatcher::Search(ImageView reference, DepthMap* map) {
  PrepareWindows(reference);
  const int num_cells = width_ * height_;
  for (int i = 0; i < num_cells; ++i) {
    if (cells_[i].is_usable) estimates_[i] = {first_[i], DataCost(i, first_[i])};
  }
  for (int iteration = 0; iteration < options_.num_iterations; ++iteration) {
    for (const int colour : {0, 1}) {
      for (int i = 0; i < num_cells; ++i) {
        if (i % width_ == 0 && stop_ != nullptr && stop_->load(std::memory_order_relaxed)) {
          return Status(StatusCode::kCancelled);
        }
        if ((i % width_ + i / width_) % 2 == colour && cells_[i].is_usable) Improve(i, iteration);
      }
    }
  }
  for (int i = 0; i < num_cells; ++i) {
    if (cells_[i].is_usable) Answer(i, map);
  }
  return Status::Ok();
}

Status DepthMatcher::SearchElsewhere(ImageView reference, DepthMap* map) {
  for (int s = 0; s < num_sources_; ++s) {
    solver_sources_[s].grey = sources_[s].grey;
    for (int k = 0; k < 9; ++k) solver_sources_[s].rotation[k] = static_cast<float>(sources_[s].rotation(k / 3, k % 3));
    for (int k = 0; k < 3; ++k) solver_sources_[s].translation[k] = static_cast<float>(sources_[s].translation[k]);
  }
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    for (int k = 0; k < 3; ++k)
      solver_planes_[3 * i + k] = cells_[i].is_usable ? static_cast<float>(first_[i][k]) : 0.0f;
  }
  DepthProblem problem;
  problem.reference = reference;
  problem.sources = std::span<const DepthSource>(solver_sources_).first(num_sources_);
  problem.first_planes = solver_planes_;
  problem.min_inverse_range = static_cast<float>(min_inverse_);
  problem.max_inverse_range = static_cast<float>(max_inverse_);
  HAUSTRA_TRY(solver_->Solve(problem, solver_ranges_, solver_confidences_));
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    if (solver_ranges_[i] > 0.0f) map->Set(static_cast<int>(i), solver_ranges_[i], solver_confidences_[i]);
  }
  return Status::Ok();
}

Status DepthMatcher::Match(const DepthView& reference, std::span<const DepthView> sources,
                           std::span<const DepthSeed> seeds, DepthMap* map) {
  const auto fits = [&](const DepthView& view) {
    return view.grey.format == PixelFormat::kGrey8 && view.grey.width == camera_.width_px() &&
           view.grey.height == camera_.height_px() && view.grey.data != nullptr;
  };
  if (map->width() != width_ || map->height() != height_) return Status(StatusCode::kInvalidArgument);
  if (!fits(reference) || !std::all_of(sources.begin(), sources.end(), fits)) {
    return Status(StatusCode::kInvalidArgument);
  }
  map->Clear(1.0);
  const auto has_range = [](const DepthSeed& seed) { return seed.inverse_range > 0.0; };
  const auto num_seeds = static_cast<std::size_t>(std::count_if(seeds.begin(), seeds.end(), has_range));
  if (num_seeds < kMinSeeds || sources.empty()) return Status(StatusCode::kFailedPrecondition);
  // The range of the seeds without its ends: by counting, since nothing may be sorted in a memory that is not there.
  // Equal ones stand by each other, so that some are always left.
  double least = std::numeric_limits<double>::infinity(), most = 0.0;
  for (const DepthSeed& seed : seeds) {
    if (!has_range(seed)) continue;
    std::size_t num_below = 0, num_above = 0;
    for (const DepthSeed& other : seeds) {
      if (&other == &seed || !has_range(other)) continue;
      num_below += other.inverse_range <= seed.inverse_range ? 1 : 0;
      num_above += other.inverse_range >= seed.inverse_range ? 1 : 0;
    }
    const double limit = kSeedQuantile * static_cast<double>(num_seeds);
    if (static_cast<double>(std::min(num_below, num_above)) <= limit) continue;
    least = std::min(least, seed.inverse_range);
    most = std::max(most, seed.inverse_range);
  }
  min_inverse_ = least / kRangeMargin;
  max_inverse_ = most * kRangeMargin;
  map->Clear(0.9 / max_inverse_);

  num_sources_ = static_cast<int>(std::min(sources.size(), sources_.size()));
  for (int s = 0; s < num_sources_; ++s) {
    const SE3 source_from_reference = sources[s].cam_from_map * reference.cam_from_map.Inverse();
    sources_[s] = {sources[s].grey, source_from_reference.matrix3(), source_from_reference.translation};
  }
  const int num_cells = width_ * height_;
  seed_grid_.Take(seeds);
  for (int i = 0; i < num_cells; ++i) {
    if (!cells_[i].is_usable) continue;
    const Eigen::Vector2d place(i % width_, i / width_);
    InversePlane plane = PlaneFromSeeds(seed_grid_.FindNearest(place), place, cells_[i].bearing);
    if (!IsPossible(i, plane)) {
      plane = std::clamp(plane.dot(cells_[i].bearing), min_inverse_, max_inverse_) * cells_[i].bearing;
    }
    first_[i] = plane;
  }
  HAUSTRA_TRY(solver_ != nullptr ? SearchElsewhere(reference.grey, map) : Search(reference.grey, map));
  if (!has_mask_) EraseSurround(reference.grey, map);
  median_.Apply(reference.grey, options_.step_px, map);
  return Status::Ok();
}

void DepthMatcher::EraseSurround(ImageView grey, DepthMap* map) const {
  GoInFromEdges(width_, height_, [&](int x, int y) {
    const Cell& cell = cells_[std::size_t(y) * width_ + x];
    // With a pixel a cell there is none behind the last column, nor below the last row.
    const int left = static_cast<int>(cell.centre_x), right = std::min(left + 1, grey.width - 1);
    const int top = static_cast<int>(cell.centre_y), bottom = std::min(top + 1, grey.height - 1);
    const std::uint8_t *row = grey.row(top), *below = grey.row(bottom);
    if (row[left] + row[right] + below[left] + below[right] >= 4 * kDarkThreshold) return false;
    map->Erase(y * width_ + x);
    return true;
  });
}

}  // namespace haustra
