// The part of a camera's buffer that is wanted, as a view of it. reentrant.
#pragma once

#include <cstdint>
#include <span>

#include "capture/v4l2/v4l2_options.h"
#include "capture/v4l2/v4l2_stream.h"
#include "hal/core/views.h"

namespace haustra::capture::internal {

// Of the pictures as they are read; MJPEG gives colour.
PixelFormat FormatOf(std::uint32_t fourcc);

// Of raw formats, not MJPEG. `bytes` holds a whole picture (V4l2Format::min_bytes); `region` lies inside it, in rows
// and columns of the progressive picture. With a field the view has every other row. NV12 is its luma alone (kGrey8)
// unless it is whole and progressive, because the colour of a part does not lie right behind it.
ImageView ViewOfPicture(const V4l2Format& format, std::span<const std::uint8_t> bytes, const PictureRegion& region,
                        FieldChoice field);

// Whether the region can be cut out: inside, at even columns where two pixels share their colour, whole rows of a
// field.
Status CheckRegion(const PictureRegion& region, int width_px, int height_px, std::uint32_t fourcc, FieldChoice field);

}  // namespace haustra::capture::internal
