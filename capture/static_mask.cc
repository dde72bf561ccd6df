#include "capture/static_mask.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <utility>

#include "capture/codec/image_codec.h"
#include "capture/image_transform.h"

namespace haustra::capture::internal {
namespace {

// A mask may have grey edges, as scaling and JPEG leave them: 7 % of it where it was enlarged eight times. Of frames of
// endoscopes two fifths and more are grey.
constexpr int kMostBlack = 31, kLeastInside = 128;
constexpr double kMaxGreyPercent = 20.0;

struct MaskCount {
  std::int64_t num_inside = 0;
  std::int64_t num_grey = 0;  // in the file neither near black nor near its brightest
};

MaskCount Binarise(Image* mask) {
  int brightest = 0;  // of two levels: 255, 200, or about 150 where it is painted green
  for (int y = 0; y < mask->height(); ++y) {
    brightest = std::max<int>(brightest, *std::max_element(mask->row(y), mask->row(y) + mask->width()));
  }
  const int least_white = std::max(kLeastInside, brightest - kMostBlack);
  MaskCount count;
  for (int y = 0; y < mask->height(); ++y) {
    std::uint8_t* row = mask->row(y);
    for (int x = 0; x < mask->width(); ++x) {
      count.num_grey += row[x] > kMostBlack && row[x] < least_white;
      row[x] = row[x] >= kLeastInside ? 255 : 0;
      count.num_inside += row[x] != 0;
    }
  }
  return count;
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
  const MaskCount count = Binarise(&mask);
  if (count.num_inside == 0) {
    return InvalidArgument(path + ": the mask leaves nothing of the image, no pixel has " +
                           std::to_string(kLeastInside) + " or more");
  }
  const double grey_percent = 100.0 * count.num_grey / (static_cast<double>(mask.width()) * mask.height());
  if (grey_percent > kMaxGreyPercent) {
    char text[120];
    std::snprintf(text, sizeof(text),
                  ": %.1f %% of it is grey, not black or white (at most %.0f %%); no mask, a picture?", grey_percent,
                  kMaxGreyPercent);
    return InvalidArgument(path + text);
  }
  if (!halve) return mask;
  Image half;
  HalveMask(mask.view(), &half);
  return half;
}

}  // namespace haustra::capture::internal
