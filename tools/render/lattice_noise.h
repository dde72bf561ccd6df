// Repeatable noise on integer lattices: the same seed gives the same field on every machine, whatever order it is asked
// in. reentrant.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geometry/rng.h"

namespace haustra::render {

// 32 well mixed bits of a lattice point.
inline std::uint32_t HashLattice(std::uint32_t x, std::uint32_t y, std::uint32_t seed) {
  std::uint32_t h = (x * 0x8da6b343u) ^ (y * 0xd8163841u) ^ (seed * 0xcb1ab31fu);
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 12;
  h *= 0x297a2d39u;
  h ^= h >> 15;
  return h;
}
// Uniform in [0, 1).
inline float UnitFromHash(std::uint32_t hash) { return static_cast<float>(hash >> 8) * 0x1p-24f; }

// Gradient noise, twice differentiable, about [-1, 1] with standard deviation near 0.35. One lattice cell is one unit;
// periodic in y with `period_y` cells (0: not periodic).
class GradientNoise {
 public:
  GradientNoise(std::uint32_t seed, int period_y) : seed_(seed), period_y_(period_y) {}
  float At(float x, float y) const;

 private:
  std::uint32_t seed_;
  int period_y_;
};

// Distances to the two nearest of a random set of points, one in each lattice cell (Worley 1996), in cells.
class CellNoise {
 public:
  struct Distances {
    float nearest = 0.0f;
    float second = 0.0f;
  };
  CellNoise(std::uint32_t seed, int period_y) : seed_(seed), period_y_(period_y) {}
  Distances At(float x, float y) const;

 private:
  std::uint32_t seed_;
  int period_y_;
};

// A smooth function of one variable inside [-1, 1]: a sum of sines with random phases. Its derivatives exist to any
// order, so that a camera that follows it has no jerk.
class Wander {
 public:
  // Frequencies in cycles per unit of the argument.
  Wander(Rng& rng, double min_frequency, double max_frequency);
  double At(double x) const;

 private:
  struct Wave {
    double frequency, phase, amplitude;
  };
  std::vector<Wave> waves_;
};

}  // namespace haustra::render
