// Pictures with brightness and colour apart, as cameras send them (hal/core/views.h). reentrant; the output is resized
// as needed and must not share memory with the input.
#pragma once

#include "capture/image.h"
#include "hal/core/views.h"

namespace haustra {

// The luma as it came; of a BGR picture by the weights of ITU-R BT.601.
void LumaToGrey(ImageView image, Image* grey);

// Average of the luma of each 2x2 block, rounded to nearest; an odd last row or column is left out. Not for BGR, of
// which HalveImage keeps the colour.
void HalveLuma(ImageView image, Image* half);

// One field of an interlaced picture: luma averaged over two columns, of every row of `field`. The rows of the other
// field are not part of the view: its pitch steps over them.
void HalveColumns(ImageView field, Image* half);

// Colour as JPEG has it (BT.601, full range), so that the luma of the result is the luma that came. Grey stays grey.
void ToBgr(ImageView image, Image* colour);

}  // namespace haustra
