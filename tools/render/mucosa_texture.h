// The mucosa as a picture of the wall: colour, wetness and the slope of its relief, with coarser copies for distant
// places. Fixed to the surface. Surface coordinates in mm: u along the wall, v around the girth (periodic).
// Immutable after construction; reentrant. Memory: 11 bytes a texel of 0.07 mm with the coarser copies, about 150 MB
// for a colon of 250 mm, whose wall is longer than its axis.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tools/render/colon.h"
#include "tools/render/mucosa_painter.h"

namespace haustra::render {

// All filtered over the pixel's footprint.
struct MucosaSample {
  float rgb[3];   // linear reflectance
  float wetness;  // 0 dry, 1 wet
  float slope_u;  // of the relief, mm per mm
  float slope_v;
  float blood_rank = 0.0f;  // in which order blood covers it; 0 where there is none
};

// The part of the wall that one pixel covers, as an ellipse.
struct Footprint {
  float u_mm, v_mm;          // centre
  float major_u, major_v;    // unit direction of the long axis
  float major_mm, minor_mm;  // its full extents
};

class MucosaTexture {
 public:
  static constexpr float kGirthMm = kMucosaGirthMm;

  MucosaTexture(const MucosaStyle& style, const Colon& colon, std::uint64_t seed, int num_threads);

  // Towards the pole of the blind end meridians converge; the dome therefore has a flat picture of its own, which fades
  // in over the picture of the tube.
  MucosaSample Sample(const Footprint& footprint) const;

 private:
  struct Level {
    int rows = 0, columns = 0;
    std::vector<std::uint8_t> texels;  // kChannels bytes each
  };
  static constexpr int kChannels = 8;  // colour, wetness, two slopes, order of blood; one is spare, for alignment

  void AddCoarserLevels();
  MucosaSample SampleFlat(const Footprint& footprint) const;

  float pole_mm_;         // u of the pole
  float dome_mm_;         // u from where the dome's own picture may be used to the pole
  float dome_centre_mm_;  // u of the pole in the dome's own picture
  std::vector<Level> levels_;
};

}  // namespace haustra::render
