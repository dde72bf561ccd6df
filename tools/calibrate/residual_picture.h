// A picture of what an estimated calibration leaves unexplained: the image in cells, coloured by the RMS of the
// residuals in them (blue 0, red 2 px and more), with the mean residual of each as an arrow, enlarged 50 times. Noise
// has short arrows in all directions; a wrong model has arrows that agree. Shows nothing of the clip. reentrant.
#pragma once

#include <span>

#include "capture/image.h"
#include "engine/calibration/self_calibration.h"

namespace haustra {

// kBgr8, of the size of the frames.
Image DrawResiduals(std::span<const calibration::Residual> residuals, int width_px, int height_px);

}  // namespace haustra
