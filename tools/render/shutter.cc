#include "tools/render/shutter.h"

#include <string>

namespace haustra::render {

Status Shutter::Validate() const {
  const auto fail = [](const char* name, double value, const char* range) {
    return InvalidArgument(std::string(name) + " is " + std::to_string(value) + ", must be in " + range +
                           " of the frame period");
  };
  if (!(exposure >= 0.0 && exposure <= 1.0)) return fail("exposure", exposure, "[0, 1]");
  if (!(readout >= 0.0 && readout <= 1.0)) return fail("readout", readout, "[0, 1]");
  if (!(field_lag >= 0.0 && field_lag <= 0.5)) return fail("field lag", field_lag, "[0, 0.5]");
  return Status::Ok();
}

}  // namespace haustra::render
