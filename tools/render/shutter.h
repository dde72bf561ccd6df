// How the camera takes a picture over time. All zero: rows at once, for a short while.
#pragma once

#include "hal/core/status.h"

namespace haustra::render {

// Shares of the frame period. The time of a frame is the middle of the exposure of its middle row, of the first field.
struct Shutter {
  double exposure = 0.0;   // how long each row is exposed, [0, 1]; at least 1/500 s, longer in a blur event
  double readout = 0.0;    // from the first row to the one behind the last, [0, 1]; 0: all rows at once
  double field_lag = 0.0;  // by which odd rows are later, [0, 0.5]; 0: no fields, 0.5: interlaced video

  // kInvalidArgument names what is out of range.
  Status Validate() const;
};

}  // namespace haustra::render
