#include "tools/render/fluid_level.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/geometry/rng.h"
#include "tools/render/smooth_step.h"

namespace haustra::render {
namespace {

constexpr double kFullTurn = 2.0 * std::numbers::pi;
// Of the colon's length, when gravity is drawn.
constexpr int kPlaces = 400;
// How much of a drawn direction along the colon stays: 0 would be undefined for a straight one.
constexpr double kAlongColon = 0.02;

constexpr int kWaves = 7;
constexpr double kMinWaveMm = 4.0, kMaxWaveMm = 17.0;
constexpr double kMinWaveMmPerS = 4.0, kMaxWaveMmPerS = 11.0;
constexpr float kWaveSlope = 0.06f;  // root mean square

constexpr double kDriftMmPerS = 1.6;
constexpr double kBubbleCellMm = 2.1, kBubblePatchMm = 11.0, kCloudMm = 11.0;
constexpr float kMinBubble = 0.1f, kMaxBubble = 0.46f;  // radius in cells: a bubble stays in its cell
constexpr float kSteepestBubble = 2.2f;                 // slope at its rim

// Gravity across the way the colon goes: a drawn direction, turned to where the colon extends least.
Eigen::Vector3d DrawUp(const Centreline& centreline, Rng& rng) {
  Eigen::Matrix3d along = kAlongColon * Eigen::Matrix3d::Identity();
  for (int i = 0; i < kPlaces; ++i) {
    const Eigen::Vector3d tangent = centreline.At(centreline.length_mm() * (i + 0.5) / kPlaces).tangent;
    along += tangent * tangent.transpose() / kPlaces;
  }
  Eigen::Vector3d drawn;
  do {
    for (int i = 0; i < 3; ++i) drawn[i] = rng.Uniform(-1.0, 1.0);
  } while (drawn.norm() < 0.1 || drawn.norm() > 1.0);
  return (along.inverse() * drawn).normalized();
}

}  // namespace

FluidLevel::FluidLevel(double share, const Centreline& centreline, std::uint64_t seed)
    : share_(share), up_(Eigen::Vector3d::UnitZ()), bubble_seed_(0), bubble_patches_(0, 0), clouds_(0, 0) {
  Rng rng(seed, 0xf1d0);
  up_ = DrawUp(centreline, rng);
  level_x_ = up_.unitOrthogonal();
  level_y_ = up_.cross(level_x_);
  for (int i = 0; i < kWaves; ++i) {
    const double per_mm = kFullTurn / (kMinWaveMm * std::pow(kMaxWaveMm / kMinWaveMm, rng.Uniform()));
    const double heading = rng.Uniform(0.0, kFullTurn);
    const double speed = rng.Uniform(kMinWaveMmPerS, kMaxWaveMmPerS);
    waves_.push_back({per_mm * std::cos(heading), per_mm * std::sin(heading), per_mm * speed,
                      rng.Uniform(0.0, kFullTurn), kWaveSlope * std::sqrt(2.0f / kWaves)});
  }
  const double heading = rng.Uniform(0.0, kFullTurn);
  drift_mm_per_s_ = kDriftMmPerS * Eigen::Vector2d(std::cos(heading), std::sin(heading));
  bubble_seed_ = rng.Next();
  bubble_patches_ = GradientNoise(rng.Next(), 0);
  clouds_ = GradientNoise(rng.Next(), 0);
}

std::vector<double> FillPools(std::span<const double> floor_mm, double depth_mm) {
  // A stretch of the channel, and whether what runs over its ends is stopped there by a wall.
  struct Stretch {
    int begin, end;
    bool is_walled_before, is_walled_after;
  };
  std::vector<double> level_mm(floor_mm.size(), FluidLevel::kDry);
  std::vector<Stretch> open = {{0, static_cast<int>(floor_mm.size()), true, true}};
  while (!open.empty()) {
    const Stretch stretch = open.back();
    open.pop_back();
    if (stretch.begin >= stretch.end) continue;
    const auto first = floor_mm.begin() + stretch.begin, last = floor_mm.begin() + stretch.end;
    const auto lowest = std::min_element(first, last);
    double level = *lowest + depth_mm;
    if (!stretch.is_walled_before) level = std::min(level, *std::max_element(first, lowest + 1));
    if (!stretch.is_walled_after) level = std::min(level, *std::max_element(lowest, last));
    int begin = static_cast<int>(lowest - floor_mm.begin()), end = begin + 1;
    while (begin > stretch.begin && floor_mm[begin - 1] < level) --begin;
    while (end < stretch.end && floor_mm[end] < level) ++end;
    if (*lowest < level) std::fill(level_mm.begin() + begin, level_mm.begin() + end, level);
    // What stands beside it runs off into it.
    open.push_back({stretch.begin, begin, stretch.is_walled_before, false});
    open.push_back({end, stretch.end, false, stretch.is_walled_after});
  }
  return level_mm;
}

void FluidLevel::FindLevels(const ColonMesh& mesh, const Breathing& breathing, double time_s,
                            std::vector<double>* level_mm) const {
  std::vector<double> floor_mm(mesh.num_rings());
  for (int i = 0; i < mesh.num_rings(); ++i) {
    const WallMotion motion = breathing.Motion(mesh.ring(i).arc_mm, time_s);
    double lowest = std::numeric_limits<double>::infinity();
    for (int j = 0; j < ColonMesh::kVerticesPerRing; ++j) lowest = std::min(lowest, up_.dot(mesh.Moved(i, j, motion)));
    floor_mm[i] = lowest;
  }
  // A lumen that closes is not filled more.
  *level_mm = FillPools(floor_mm, share_ * Breathing::kUsualRadiusMm * breathing.pressure.RadiusGain(time_s));
}

LiquidSurface FluidLevel::SurfaceAt(const Eigen::Vector3d& point, double time_s, float footprint_mm) const {
  const double x = level_x_.dot(point), y = level_y_.dot(point);
  LiquidSurface surface;
  for (const Wave& wave : waves_) {
    // Averaged over a bell as wide as the pixel.
    const double k2 = wave.along_x * wave.along_x + wave.along_y * wave.along_y;
    const auto left = static_cast<float>(std::exp(-k2 * footprint_mm * footprint_mm / 8.0));
    const double phase = wave.along_x * x + wave.along_y * y - wave.per_s * time_s + wave.phase_rad;
    const float slope = left * wave.slope * static_cast<float>(std::cos(phase) / std::sqrt(k2));
    surface.slope_x += slope * static_cast<float>(wave.along_x);
    surface.slope_y += slope * static_cast<float>(wave.along_y);
  }

  const Eigen::Vector2d drifted = Eigen::Vector2d(x, y) - time_s * drift_mm_per_s_;
  const Eigen::Vector2f coarse = (drifted / kCloudMm).cast<float>(), fine = 3.1f * coarse;
  surface.cloud = 1.5f * clouds_.At(coarse.x(), coarse.y()) + 0.8f * clouds_.At(fine.x(), fine.y());

  const Eigen::Vector2d at = drifted / kBubbleCellMm, corner = at.array().floor();
  const Eigen::Vector2f patch = ((corner.array() + 0.5) * (kBubbleCellMm / kBubblePatchMm)).cast<float>();
  const float share = 0.03f + 0.9f * SmoothStep(0.05f, 0.5f, bubble_patches_.At(patch.x(), patch.y()));
  std::uint32_t hash = HashLattice(static_cast<std::uint32_t>(static_cast<std::int64_t>(corner.x())),
                                   static_cast<std::uint32_t>(static_cast<std::int64_t>(corner.y())), bubble_seed_);
  const auto draw = [&hash] { return UnitFromHash(hash = HashLattice(hash, 0x9b1u, 0x51f15eu)); };
  if (draw() >= share) return surface;
  const float size = draw();
  const float radius = kMinBubble + (kMaxBubble - kMinBubble) * size * size;
  Eigen::Vector2f middle;
  for (float& place : middle) place = radius + (1.0f - 2.0f * radius) * draw();
  const Eigen::Vector2f from_middle = (at - corner).cast<float>() - middle;
  const float out = from_middle.norm() / radius;
  if (out >= 1.0f) return surface;
  // A dome; one that is smaller than the pixel is only pale.
  const float shown = 1.0f - SmoothStep(0.5f, 1.5f, footprint_mm / (radius * static_cast<float>(kBubbleCellMm)));
  const float steep =
      std::min(1.0f / std::sqrt(std::max(1.0f - out * out, 1e-3f)), kSteepestBubble / std::max(out, 0.1f));
  const Eigen::Vector2f slope = -from_middle / radius * steep;
  surface.slope_x += shown * (slope.x() - surface.slope_x);
  surface.slope_y += shown * (slope.y() - surface.slope_y);
  surface.foam = 0.22f + 0.5f * shown * SmoothStep(0.6f, 1.0f, out);
  return surface;
}

}  // namespace haustra::render
