#include "platform/daemon/open_source.h"

#include "capture/open_sequence.h"

namespace haustra {

bool IsCamera(const SourceConfig& config) { return config.path.starts_with("v4l2:"); }

Result<std::unique_ptr<FrameSource>> OpenSource(const SourceConfig& config) {
  SequenceOptions options;
  options.every_nth = static_cast<std::uint32_t>(config.every_nth);
  options.halve = config.halve;
  HAUSTRA_ASSIGN(options.deinterlace, ParseDeinterlaceChoice(config.deinterlace));
  options.calibration_path = config.calibration;
  options.mask_path = config.mask;
  return OpenSequence(config.path, options);
}

}  // namespace haustra
