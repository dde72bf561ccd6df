// In which order the places of the wall are covered by something that spreads: patches with ragged edges that grow and
// meet. Grid of the mucosa's texture: rows along the wall, columns around the girth. Immutable; reentrant.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tools/render/lattice_noise.h"

namespace haustra::render {

class CoverOrder {
 public:
  // patch_mm: usual width of a patch.
  CoverOrder(std::uint32_t seed, int rows, float patch_mm);

  // Share of the grid that is covered before this place, [0, 1]: of all places, a share x has a rank below x.
  float Rank(int row, int column) const;

 private:
  float Height(int row, int column) const;

  struct Octave {
    GradientNoise noise;
    float cells_per_texel, weight;
  };
  std::vector<Octave> octaves_;
  std::vector<float> quantiles_;  // of the height, from high to low
};

}  // namespace haustra::render
