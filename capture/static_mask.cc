#include "capture/static_mask.h"

#include <utility>

#include "capture/codec/image_codec.h"
#include "capture/image_transform.h"

namespace haustra::capture::internal {
namespace {

// Returns whether any pixel is inside.
bool Binarise(Image* mask) {
  bool any_inside = false;
  for (int y = 0; y < mask->height(); ++y) {
    std::uint8_t* row = mask->row(y);
    for (int x = 0; x < mask->width(); ++x) {
      row[x] = row[x] >= 128 ? 255 : 0;
      any_inside = any_inside || row[x] != 0;
    }
  }
  return any_inside;
}

}  // namespace

Result<Image> ReadStaticMask(const std::string& path, const CameraCalibration& stored_calibration, bool halve) {
  if (path.empty()) return Image();
  HAUSTRA_ASSIGN(Image mask, ReadImage(path, ChannelChoice::kGrey));
  if (mask.width() != stored_calibration.width_px || mask.height() != stored_calibration.height_px) {
    return InvalidArgument(path + ": the mask is " + std::to_string(mask.width()) + "x" +
                           std::to_string(mask.height()) + ", the calibration " +
                           std::to_string(stored_calibration.width_px) + "x" +
                           std::to_string(stored_calibration.height_px));
  }
  if (!Binarise(&mask)) return InvalidArgument(path + ": the mask leaves nothing of the image");
  if (!halve) return mask;
  Image half;
  HalveMask(mask.view(), &half);
  return half;
}

}  // namespace haustra::capture::internal
