// A film of liquid stool on the wall: brown, half transparent, thicker in some places than in others, with darker
// lumps. It is attached to the wall. Immutable; reentrant.
#pragma once

#include <cstdint>

#include "tools/render/cover_order.h"
#include "tools/render/lattice_noise.h"

namespace haustra::render {

struct MucosaTexel;

class StoolFilm {
 public:
  // share: of the wall, [0, 1]. rows: of the mucosa's texture.
  StoolFilm(double share, int rows, std::uint64_t seed);

  // Puts the film over what is painted at this texel.
  void Cover(int row, int column, MucosaTexel* texel) const;

 private:
  float share_;
  CoverOrder order_;
  GradientNoise coarse_, fine_;
  CellNoise lumps_;
};

}  // namespace haustra::render
