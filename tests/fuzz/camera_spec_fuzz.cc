#include <string_view>

#include "capture/v4l2/v4l2_options.h"
#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"

namespace haustra::test {

void FuzzCameraSpec(std::span<const std::uint8_t> bytes) {
  const Result<V4l2Options> options = ParseV4l2Spec({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  if (!options.ok()) {
    HAUSTRA_CHECK(!options.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(options->Validate().ok());
  HAUSTRA_CHECK((options->width_px > 0) == (options->height_px > 0));
  HAUSTRA_CHECK(options->region.x_px >= 0 && options->region.y_px >= 0);
  HAUSTRA_CHECK(options->rate_hz >= 0.0 && options->max_rate_hz > 0.0);
}

}  // namespace haustra::test
