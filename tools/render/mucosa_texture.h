// The mucosa as a picture of the wall: colour, wetness and the slope of its relief, with coarser copies for distant
// places. Fixed to the surface. Surface coordinates in mm: u along the wall, v around the girth (periodic).
// Immutable after construction; reentrant. About 8 bytes and 10 with the coarser copies for each texel of 0.07 mm: 85
// MB for 300 mm of colon.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tools/render/colon.h"
#include "tools/render/vessel_network.h"

namespace haustra::render {

struct MucosaStyle {
  std::array<float, 3> base_rgb = {0.60f, 0.192f, 0.122f};  // linear reflectance
  float vessels = 1.0f;                                     // gain on the vessels' absorption
  float detail = 1.0f;                                      // gain on the fine colour texture
  float mottle = 1.0f;                                      // gain on the slow changes of colour
  float relief = 1.0f;                                      // gain on the slopes that break up highlights
  float wetness = 1.0f;                                     // gain on the specular reflection
  VesselStyle arteries;
  VesselStyle veins;
};

// All filtered over the pixel's footprint.
struct MucosaSample {
  float rgb[3];   // linear reflectance
  float wetness;  // 0 dry, 1 wet
  float slope_u;  // of the relief, mm per mm
  float slope_v;
  float polyp;  // 0 to 1
};

// The part of the wall that one pixel covers, as an ellipse.
struct Footprint {
  float u_mm, v_mm;          // centre
  float major_u, major_v;    // unit direction of the long axis
  float major_mm, minor_mm;  // its full extents
};

class MucosaTexture {
 public:
  static constexpr int kColumns = 2048;
  // The girth that the texture is drawn for; where the wall is narrower, it is squeezed.
  static constexpr float kGirthMm = 138.23f;  // of a radius of 22 mm
  static constexpr float kTexelMm = kGirthMm / kColumns;

  MucosaTexture(const MucosaStyle& style, const Colon& colon, std::uint64_t seed, int num_threads);

  // Towards the pole of the blind end meridians converge; the dome therefore has a flat picture of its own, which fades
  // in over the picture of the tube.
  MucosaSample Sample(const Footprint& footprint) const;

 private:
  struct Level {
    int rows = 0, columns = 0;
    std::vector<std::uint8_t> texels;  // kChannels bytes each
  };
  static constexpr int kChannels = 8;

  void AddCoarserLevels();
  MucosaSample SampleFlat(const Footprint& footprint) const;

  float pole_mm_;         // u of the pole
  float dome_mm_;         // u from where the dome's own picture may be used to the pole
  float dome_centre_mm_;  // u of the pole in the dome's own picture
  std::vector<Level> levels_;
};

}  // namespace haustra::render
