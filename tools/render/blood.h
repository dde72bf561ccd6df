// Blood on the wall: dark red, spreading from where it bleeds until it covers a share of the wall. reentrant.
#pragma once

#include "tools/render/mucosa_texture.h"

namespace haustra::render {

// `share` of the wall is covered, [0, 1]: the places whose order is below it. What was seen there before is seen
// through blood that is thin at its edge and opaque in the middle, and wet.
void CoverWithBlood(float share, MucosaSample* sample);

}  // namespace haustra::render
