#include "tools/render/colon_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/geometry/rng.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {
namespace {

constexpr double kRingSpacingMm = 0.55;
// The pole of the dome is a ring, so that normals and texture stay defined, but one too small to be seen.
constexpr double kPoleRadius = 1e-5;
// Another day's wall is wider or narrower over stretches of this length. Noise of 0.35 becomes most of the range.
constexpr double kRemodelCellMm = 28.0;
constexpr int kRemodelCells = 5;
constexpr double kRemodelGain = 1.8;

}  // namespace

ColonMesh::ColonMesh(const Centreline& centreline, const LumenShape& shape, double dome_mm) {
  const double dome_start_mm = centreline.length_mm() - dome_mm;
  constexpr int kM = kVerticesPerRing;
  cosine_.resize(kM);
  sine_.resize(kM);
  for (int j = 0; j < kM; ++j) {
    cosine_[j] = std::cos(2.0 * std::numbers::pi * j / kM);
    sine_[j] = std::sin(2.0 * std::numbers::pi * j / kM);
  }
  const int num_tube = static_cast<int>(std::ceil(dome_start_mm / kRingSpacingMm));
  const double quarter = 0.5 * std::numbers::pi;
  const int num_dome = static_cast<int>(std::ceil(dome_mm * quarter / kRingSpacingMm));
  for (int i = 0; i < num_tube + num_dome + 1; ++i) {
    Ring ring;
    double scale = 1.0;
    if (i < num_tube) {
      ring.arc_mm = dome_start_mm * i / num_tube;
    } else {
      const double latitude = quarter * (i - num_tube) / num_dome;
      ring.arc_mm = dome_start_mm + dome_mm * std::sin(latitude);
      scale = std::max(std::cos(latitude), kPoleRadius);
    }
    ring.frame = centreline.At(ring.arc_mm);
    rings_.push_back(ring);
    for (int j = 0; j < kM; ++j) {
      const double angle = 2.0 * std::numbers::pi * j / kM;
      radius_.push_back(static_cast<float>(scale * shape.Radius(ring.arc_mm, angle)));
    }
  }
  dome_ring_ = num_tube;
  MeasureSurface();
  ComputeNormals();
  ComputeOpenness();
}

void ColonMesh::Remodel(double share, std::uint64_t seed, double min_radius_mm) {
  Rng rng(seed, 0x4e0d);
  const GradientNoise swell(rng.Next(), kRemodelCells);
  for (int i = 0; i < num_rings(); ++i) {
    for (int j = 0; j < kVerticesPerRing; ++j) {
      const double around = static_cast<double>(kRemodelCells) * j / kVerticesPerRing;
      const double noise = swell.At(static_cast<float>(rings_[i].arc_mm / kRemodelCellMm), static_cast<float>(around));
      float& radius = radius_[Index(i, j)];
      const double changed = radius * (1.0 + share * std::clamp(kRemodelGain * noise, -1.0, 1.0));
      radius = static_cast<float>(std::max(changed, std::min<double>(radius, min_radius_mm)));
    }
  }
  ComputeNormals();
  ComputeOpenness();
}

void ColonMesh::MeasureSurface() {
  rings_[0].surface_mm = 0.0;
  for (int i = 1; i < num_rings(); ++i) {
    double sum = 0.0;
    for (int j = 0; j < kVerticesPerRing; ++j) sum += (Position(i, j, 1.0) - Position(i - 1, j, 1.0)).norm();
    rings_[i].surface_mm = rings_[i - 1].surface_mm + sum / kVerticesPerRing;
  }
}

double ColonMesh::SurfaceAtArc(double arc_mm) const {
  const int i = std::clamp(FirstRingFrom(arc_mm), 1, num_rings() - 1);
  const Ring &a = rings_[i - 1], &b = rings_[i];
  const double share = std::clamp((arc_mm - a.arc_mm) / (b.arc_mm - a.arc_mm), 0.0, 1.0);
  return a.surface_mm + share * (b.surface_mm - a.surface_mm);
}

double ColonMesh::ArcAtSurface(double surface_mm) const {
  const auto it = std::lower_bound(rings_.begin() + 1, rings_.end() - 1, surface_mm,
                                   [](const Ring& ring, double at) { return ring.surface_mm < at; });
  const Ring &a = *(it - 1), &b = *it;
  const double share = std::clamp((surface_mm - a.surface_mm) / (b.surface_mm - a.surface_mm), 0.0, 1.0);
  return a.arc_mm + share * (b.arc_mm - a.arc_mm);
}

void ColonMesh::ComputeNormals() {
  normal_.resize(radius_.size());
  const int last = num_rings() - 1;
  for (int i = 0; i <= last; ++i) {
    for (int j = 0; j < kVerticesPerRing; ++j) {
      const int next = (j + 1) % kVerticesPerRing, previous = (j + kVerticesPerRing - 1) % kVerticesPerRing;
      const Eigen::Vector3d along = Position(std::min(i + 1, last), j, 1.0) - Position(std::max(i - 1, 0), j, 1.0);
      const Eigen::Vector3d around = Position(i, next, 1.0) - Position(i, previous, 1.0);
      // tangent x around points to the axis: (t, n, b) is right-handed and the angle runs from n to b.
      normal_[Index(i, j)] = along.cross(around).normalized().cast<float>();
    }
  }
}

void ColonMesh::ComputeOpenness() {
  constexpr double kWindowMm = 9.0;
  openness_.resize(radius_.size());
  const int reach = static_cast<int>(kWindowMm / kRingSpacingMm);
  for (int j = 0; j < kVerticesPerRing; ++j) {
    for (int i = 0; i < num_rings(); ++i) {
      // How deep the place lies behind the crests before and after it.
      float before = radius_[Index(i, j)], after = before;
      for (int k = 1; k <= reach; ++k) {
        before =
            std::min(before, radius_[Index(std::max(i - k, 0), j)] + 0.35f * k * static_cast<float>(kRingSpacingMm));
        after = std::min(after, radius_[Index(std::min(i + k, num_rings() - 1), j)] +
                                    0.35f * k * static_cast<float>(kRingSpacingMm));
      }
      const float depth = 2.0f * radius_[Index(i, j)] - before - after;
      openness_[Index(i, j)] = std::exp(-0.055f * depth);
    }
  }
}

int ColonMesh::FirstRingFrom(double arc_mm) const {
  const auto it = std::lower_bound(rings_.begin(), rings_.end(), arc_mm,
                                   [](const Ring& ring, double arc) { return ring.arc_mm < arc; });
  return static_cast<int>(it - rings_.begin());
}

double ColonMesh::Clearance(const Eigen::Vector3d& point_in_world, double gain) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < num_rings(); ++i) {
    if ((rings_[i].frame.position - point_in_world).norm() > 60.0) continue;
    for (int j = 0; j < kVerticesPerRing; ++j) {
      nearest = std::min(nearest, (Position(i, j, gain) - point_in_world).squaredNorm());
    }
  }
  return std::sqrt(nearest);
}

}  // namespace haustra::render
