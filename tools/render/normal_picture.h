// True normals of a rendered frame as a colour picture of 8 bits. Red, green and blue are x, y and z in the camera (x
// right, y down, z forward): 128 + 127 times the component, rounded. All three 0: not known. reentrant.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "capture/image.h"

namespace haustra::render {

// normals: width_px * height_px, row by row; unit, or zero where not known.
Image NormalPicture(const std::vector<Eigen::Vector3f>& normals, int width_px, int height_px);

}  // namespace haustra::render
