// The mucosa in narrow-band light: two bands at 415 and 540 nm, which blood absorbs far more than white light. The
// first is shown as green and blue, the second as red. Mucosa is greenish brown, fine vessels dark brown, deep veins
// towards cyan. reentrant.
#pragma once

#include <array>

#include "tools/render/mucosa_texture.h"

namespace haustra::render {

// From the reflectance in white light. Wetness and relief stay.
void ShowInNarrowBand(MucosaSample* sample);
// The same of what a clear layer lets through.
void ShowInNarrowBand(std::array<float, 3>* through);

}  // namespace haustra::render
