// How much of a wall was seen, as a whole and piece by piece along the lumen. reentrant.
#pragma once

#include <vector>

#include "engine/coverage/wall_grid.h"

namespace haustra {

// Shares of the cells of rows [first_row, end_row): of the unrolled wall, so that a fold does not count for more than
// what it covers. Never seen is what is left of 1.
struct WallCoverage {
  int first_row = 0, end_row = 0;
  double well = 0.0;
  double poorly = 0.0;  // only at a slant or from too far
};

// Of the claimed rows.
WallCoverage CoverageOf(const WallGrid& grid, int first_row, int end_row);
// Of segments of about segment_radii, all of one length, along the claimed part; the first begins where it begins. One
// at the least, none when nothing is claimed.
std::vector<WallCoverage> CoverageOfSegments(const WallGrid& grid, double segment_radii);

}  // namespace haustra
