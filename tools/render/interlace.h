// Two fields of interlaced video in one picture. reentrant.
#pragma once

#include "capture/image.h"

namespace haustra::render {

// Even rows stay, odd rows are taken from `second`. Both have one size and format.
void WeaveFields(const Image& second, Image* first);

}  // namespace haustra::render
