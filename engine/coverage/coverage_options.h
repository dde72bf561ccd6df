// Parameters of the coverage of the wall. Plain data. Lengths are in mean radii of the lumen: a monocular map has no
// scale, and the lumen is what a doctor knows the size of.
#pragma once

#include "hal/core/status.h"

namespace haustra {

struct CoverageOptions {
  // From farther away a wall does not count as seen well, radii, (0, 6]. At 3 radii (6 cm in a colon) a polyp of 5 mm
  // is 16 pixels wide in a picture of 360 lines and 110 degrees, and 6 where it is foreshortened to a third.
  double max_range_radii = 3.0;
  // Nor does a wall that is seen at more of a slant, degrees from its normal, (0, 90). 70: foreshortened to a third. A
  // straight tube is seen so 2.7 radii ahead.
  double max_slant_deg = 70.0;
  // What is farther away counts as not seen at all, radii, [max_range_radii, 12]: it is dark in most pictures.
  double far_radii = 6.0;
  // Length of a segment of the summary, radii, > 0. 2: as long as the lumen is wide.
  double segment_radii = 2.0;
  // Holes of the reconstructed wall of up to so many cells are bridged, [0, 8]: they are holes of the reconstruction. A
  // cell is 0.1 radii. Longer ones are taken as never seen.
  int max_hole_cells = 1;

  // kInvalidArgument names the field.
  Status Validate() const;
};

}  // namespace haustra
