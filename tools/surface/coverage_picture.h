// The unrolled wall as a picture: length along the lumen from left to right, angle around it from top to bottom, a
// square of pixels a cell. reentrant.
#pragma once

#include <array>
#include <cstdint>

#include "capture/image.h"
#include "engine/coverage/wall_grid.h"

namespace haustra::surface {

inline constexpr int kCellPx = 4;

// Red, green, blue. Sky blue, vermilion and black of Okabe and Ito 2008: eyes that lack a cone tell them apart by hue,
// and a grey print by brightness.
std::array<std::uint8_t, 3> ColourOf(WallView view);

// kBgr8, of the claimed rows; empty when nothing is claimed.
Image UnrolledPicture(const WallGrid& wall);

}  // namespace haustra::surface
