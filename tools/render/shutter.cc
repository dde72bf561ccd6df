#include "tools/render/shutter.h"

#include "tools/render/out_of_range.h"

namespace haustra::render {

Status Shutter::Validate() const {
  if (!(exposure >= 0.0 && exposure <= 1.0)) return OutOfRange("exposure", exposure, "[0, 1] of the frame period");
  if (!(readout >= 0.0 && readout <= 1.0)) return OutOfRange("readout", readout, "[0, 1] of the frame period");
  if (!(field_lag >= 0.0 && field_lag <= 0.5))
    return OutOfRange("field lag", field_lag, "[0, 0.5] of the frame period");
  return Status::Ok();
}

}  // namespace haustra::render
