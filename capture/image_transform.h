// Pixel operations that a frame source applies before it hands a frame out. reentrant; the output is resized as needed
// and must not share memory with the input.
#pragma once

#include "capture/image.h"
#include "hal/core/views.h"

namespace haustra {

// Average of each 2x2 block, rounded to nearest, channel by channel; an odd last row or column is left out. Goes with
// Halved() of hal/camera_calibration.h.
void HalveImage(ImageView image, Image* half);

// Halves a mask: 255 where all four pixels of the block are at least 128, 0 elsewhere, so that no pixel of the halved
// frame that is inside the mask has a share of the surround. Grey input.
void HalveMask(ImageView mask, Image* half);

// Luma of a BGR image by the weights of ITU-R BT.601, which JPEG uses; copies a grey one.
void ToGrey(ImageView image, Image* grey);

// Copies the pixels, of kNv12 the plane of colour, too.
void CopyImage(ImageView image, Image* copy);

}  // namespace haustra
