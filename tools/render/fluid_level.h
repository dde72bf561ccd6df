// Liquid that stands in the colon: pools on its low side, each with a level surface. Gravity has one direction in the
// world, drawn from the seed: across the way the colon mostly goes, as in a patient who lies.
//
// Each pool is as deep as asked for, or as deep as the next crest of the wall lets it be; what is more runs off. Pools
// that meet have one level. The surface has ripples and carries bubbles that drift. World frame, mm. Immutable;
// reentrant.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "tools/render/breathing.h"
#include "tools/render/centreline.h"
#include "tools/render/colon_mesh.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {

// The surface of a pool at one place.
struct LiquidSurface {
  float slope_x = 0.0f, slope_y = 0.0f;  // along the two level directions
  float foam = 0.0f;                     // share that bubbles take
  float cloud = 0.0f;                    // turbid more or less than usual, about [-1, 1]
};

class FluidLevel {
 public:
  // Of the usual radius. Deeper pools would reach the scope.
  static constexpr double kMaxShare = 0.6;
  // The level where nothing stands.
  static constexpr double kDry = -std::numeric_limits<double>::infinity();

  // share: depth of the pools over the usual radius, [0, kMaxShare].
  FluidLevel(double share, const Centreline& centreline, std::uint64_t seed);

  bool is_active() const { return share_ > 0.0; }
  // Against gravity, and two level directions; unit, each across the others.
  const Eigen::Vector3d& up() const { return up_; }
  const Eigen::Vector3d& level_x() const { return level_x_; }
  const Eigen::Vector3d& level_y() const { return level_y_; }

  // How high along up() the liquid stands at each ring of the wall as it is at that time; kDry where none does.
  // Rings of one pool have the same level, and at least one dry ring lies between two pools.
  void FindLevels(const ColonMesh& mesh, const Breathing& breathing, double time_s,
                  std::vector<double>* level_mm) const;

  // Ripples, bubbles and clouds at a point of a surface, averaged over a pixel of that size.
  LiquidSurface SurfaceAt(const Eigen::Vector3d& point, double time_s, float footprint_mm) const;

 private:
  struct Wave {
    double along_x, along_y;  // radians per mm
    double per_s, phase_rad;
    float slope;
  };

  double share_;
  Eigen::Vector3d up_, level_x_, level_y_;
  std::vector<Wave> waves_;
  Eigen::Vector2d drift_mm_per_s_;
  std::uint32_t bubble_seed_;
  GradientNoise bubble_patches_, clouds_;
};

// Pools in a channel with this floor and with walls at both ends: each is depth_mm deep over its lowest place, less
// where it would run over a crest to a lower place. kDry where no liquid stands.
std::vector<double> FillPools(std::span<const double> floor_mm, double depth_mm);

}  // namespace haustra::render
