#include "capture/v4l2/picture_view.h"

#include <linux/videodev2.h>

#include <string>

namespace haustra::capture::internal {
namespace {

std::string RegionText(const PictureRegion& region) {
  return std::to_string(region.width_px) + "x" + std::to_string(region.height_px) + "+" + std::to_string(region.x_px) +
         "+" + std::to_string(region.y_px);
}

}  // namespace

PixelFormat FormatOf(std::uint32_t fourcc) {
  switch (fourcc) {
    case V4L2_PIX_FMT_YUYV: return PixelFormat::kYuyv;
    case V4L2_PIX_FMT_UYVY: return PixelFormat::kUyvy;
    case V4L2_PIX_FMT_NV12: return PixelFormat::kNv12;
    case V4L2_PIX_FMT_MJPEG: return PixelFormat::kBgr8;
    default: return PixelFormat::kGrey8;
  }
}

ImageView ViewOfPicture(const V4l2Format& format, std::span<const std::uint8_t> bytes, const PictureRegion& region,
                        FieldChoice field) {
  using Rows = V4l2Format::Rows;
  ImageView view;
  view.data = bytes.data();
  view.width = format.width_px;
  view.height = format.height_px;
  view.pitch_bytes = format.pitch_bytes;
  view.format = FormatOf(format.fourcc);
  const bool is_cut = !region.is_whole() && (region.width_px != view.width || region.height_px != view.height);
  const bool is_even = view.width % 2 == 0 && view.height % 2 == 0;
  if (view.format == PixelFormat::kNv12 && (is_cut || field != FieldChoice::kProgressive || !is_even)) {
    view.format = PixelFormat::kGrey8;
  }
  int region_y = region.y_px;
  int region_height = region.height_px;
  if (field != FieldChoice::kProgressive) {
    const bool is_top = field == FieldChoice::kTop;
    if (format.rows == Rows::kInterleaved) {
      view.data += is_top ? 0 : view.pitch_bytes;
      view.pitch_bytes *= 2;
      view.height /= 2;
    } else if (format.rows == Rows::kTopThenBottom || format.rows == Rows::kBottomThenTop) {
      view.height /= 2;
      view.data += is_top == (format.rows == Rows::kTopThenBottom) ? 0 : view.pitch_bytes * view.height;
    }
    region_y /= 2;
    region_height /= 2;
  }
  if (is_cut) {
    view.data += region_y * view.pitch_bytes + region.x_px * BytesPerPixel(view.format);
    view.width = region.width_px;
    view.height = region_height;
  }
  return view;
}

Status CheckRegion(const PictureRegion& region, int width_px, int height_px, std::uint32_t fourcc, FieldChoice field) {
  if (region.is_whole()) return Status::Ok();
  if (region.x_px < 0 || region.y_px < 0 || region.x_px > width_px - region.width_px ||
      region.y_px > height_px - region.height_px) {
    return InvalidArgument("region " + RegionText(region) + " does not lie inside the picture of " +
                           std::to_string(width_px) + "x" + std::to_string(height_px));
  }
  const bool is_paired = fourcc == V4L2_PIX_FMT_YUYV || fourcc == V4L2_PIX_FMT_UYVY;
  if (is_paired && (region.x_px % 2 != 0 || region.width_px % 2 != 0)) {
    return InvalidArgument("region " + RegionText(region) + ": in " + FourccText(fourcc) +
                           " two columns share their colour; begin and width must be even");
  }
  if (field != FieldChoice::kProgressive && (region.y_px % 2 != 0 || region.height_px % 2 != 0)) {
    return InvalidArgument("region " + RegionText(region) + ": of an interlaced picture begin and height must be even");
  }
  return Status::Ok();
}

}  // namespace haustra::capture::internal
