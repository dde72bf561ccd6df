// Paints the mucosa at full resolution: colour with vessels at several scales, wetness, relief. What is painted at a
// texel depends on the seed and the place alone. Rows run along the wall, columns around the girth.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/geometry/rng.h"
#include "tools/render/cover_order.h"
#include "tools/render/lattice_noise.h"
#include "tools/render/lumen_shape.h"
#include "tools/render/stool_film.h"
#include "tools/render/vessel_network.h"

namespace haustra::render {

struct BloodStyle {
  double share = 0.0;      // of the wall that is covered in the end, [0, 1]
  double spread_s = 10.0;  // from nothing to that, [0, 3600]; 0: covered from the start

  double ShareAt(double time_s) const {
    return share * (spread_s > 0.0 ? std::clamp(time_s / spread_s, 0.0, 1.0) : 1.0);
  }
};

struct MucosaStyle {
  std::array<float, 3> base_rgb = {0.60f, 0.192f, 0.122f};  // linear reflectance
  float vessels = 1.0f;                                     // gain on the vessels' absorption
  float detail = 1.0f;                                      // gain on the fine colour texture
  float mottle = 1.0f;                                      // gain on the slow changes of colour
  float relief = 1.0f;                                      // gain on the slopes that break up highlights
  float wetness = 1.0f;                                     // gain on the specular reflection
  double stool = 0.0;                                       // share of the wall below a film of stool, [0, 1]
  BloodStyle blood;
  VesselStyle arteries;
  VesselStyle veins;
};

// The grid that is painted on.
inline constexpr int kMucosaColumns = 2048;
// The girth that the texture is drawn for; where the wall is narrower, it is squeezed.
inline constexpr float kMucosaGirthMm = 138.23f;  // of a radius of 22 mm
inline constexpr float kMucosaTexelMm = kMucosaGirthMm / kMucosaColumns;

struct MucosaTexel {
  float rgb[3];      // linear reflectance
  float wetness;     // 0 dry, 1 wet
  float height_mm;   // of the relief
  float blood_rank;  // in which order blood covers it, [0, 1]; 0 where there is none
};

// Immutable after construction, which draws the vessels; reentrant. About 150 ns a texel.
class MucosaPainter {
 public:
  // Keeps a reference to the shape.
  MucosaPainter(const MucosaStyle& style, const LumenShape& shape, int rows, std::uint64_t seed);

  // arc_mm: of the row along the centre line, where its polyps are; below 0: on no part of the tube.
  void PaintRow(int row, double arc_mm, std::vector<MucosaTexel>* texels) const;

 private:
  // Gradient noise of a wavelength near the wanted one that fits the girth a whole number of times.
  struct Octave {
    GradientNoise noise;
    float cells_per_texel;
    Octave(std::uint32_t seed, float wavelength_mm);
    float At(int row, int column) const {
      return noise.At(static_cast<float>(row) * cells_per_texel, static_cast<float>(column) * cells_per_texel);
    }
  };
  // What varies slowly: computed at every few texels of a row and interpolated.
  struct Slow {
    float blotch, patch, tint, net_mask, coarse_grain, coarse_relief, from_follicle;
  };
  Slow SlowAt(int row, int column) const;
  float FollicleDistance(int row, int column) const;
  MucosaTexel At(int row, int column, double arc_mm, const Slow& slow) const;

  MucosaStyle style_;
  const LumenShape& shape_;
  SurfaceMap arteries_, veins_;
  Rng rng_;  // the members below draw from it in order
  Octave blotch_, patch_, tint_;
  std::array<Octave, 4> grain_, relief_;  // coarse to fine
  Octave net_mask_;
  CellNoise net_, follicles_;
  std::optional<StoolFilm> stool_;
  std::optional<CoverOrder> blood_;
};

}  // namespace haustra::render
